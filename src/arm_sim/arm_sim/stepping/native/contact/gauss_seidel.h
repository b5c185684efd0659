/* SPDX-License-Identifier: Apache-2.0
 *
 * Contacts solved one after another until nothing changes (Jourdan, Alart, Jean, "A Gauss-Seidel like algorithm to solve
 * frictional contact problems", Comput. Methods Appl. Mech. Eng. 155, 1998).
 */

#pragma once
#include "contact/contact_problem.h"
#include "contact/one_contact.h"

#define SWEEP_TOLERANCE 1e-15 /* change of the forces at which sweeps end, relative to the contact's own */

/* Solve one contact after another (Gauss-Seidel): 1 if this converges. */
static int sweep(const scene_t* scene, const cones_t* cones, double* r, int sweeps, contact_solution_t* answers) {
  double block[3][3], change[NC + 1];
  for (int k = 0; k < NC; ++k) answers[k] = apart;
  for (int turn = 0; turn < sweeps; ++turn) {
    int settled = 1;
    for (int k = 0; k < NC; ++k) {
      change[k] = 0.0;
      if (cones->is_touching[k] == 0.0) continue;
      double others[3];
      own_block(scene, cones->W, k, block);
      for (int i = 0; i < 3; ++i) {
        others[i] = cones->c[3 * k + i];
        for (int j = 0; j < MC; ++j)
          if (j / 3 != k) others[i] += AT(cones->W, MC, 3 * k + i, j) * r[j];
      }
      answers[k] = solve_contact(block, others, cones->mu[k], cones->mu_static[k],
                                 cones->was_sliding[k] != 0.0 ? cones->sliding_direction + 2 * k : 0);
      for (int i = 0; i < 3; ++i) {
        change[k] = fmax(change[k], fabs(answers[k].force[i] - r[3 * k + i]));
        r[3 * k + i] = answers[k].force[i];
      }
    }
    for (int k = 0; k < NC; ++k) {
      settled &= change[k] == 0.0 || change[k] <= SWEEP_TOLERANCE * own_size(scene, cones, r, k);
      settled &= answers[k].state != UNSOLVABLE || cones->was_sliding[k] != 0.0; /* what starts to slide has a solution */
    }
    if (settled) return 1;
  }
  return 0;
}
