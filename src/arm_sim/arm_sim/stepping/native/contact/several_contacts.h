/* SPDX-License-Identifier: Apache-2.0
 *
 * Forces of several contacts: one after another, and where that converges slowly, all together by Newton's
 * method; as the last resort by continuation.
 */

#pragma once
#include "contact/gauss_seidel.h"
#include "contact/newton.h"

#define CONTINUATION_STEPS 20 /* in which friction grows from zero, as the last resort */

/* Set the fraction of all friction with which the problem is solved. */
static void scale_friction(const scene_t* scene, cones_t* cones, double part) {
  for (int k = 0; k < NC; ++k) {
    cones->mu[k] = cones->friction[k] * part;
    cones->mu_static[k] = cones->static_friction[k] * part;
  }
}

/* Solve for several contacts: 0 if no solution is found. */
static int solve_contacts(const scene_t* scene, cones_t* cones, contact_solution_t* answers) {
  static const int sweeps[2] = {20, 200}; /* sweeps before Newton's method is tried, and tried again */
  double r[MC + 1];
  int solved = 0;
  for (int i = 0; i < MC; ++i) r[i] = 0.0;
  scale_friction(scene, cones, 1.0);
  for (int k = 0; k < 2; ++k)
    if (sweep(scene, cones, r, sweeps[k], answers) || newton(scene, cones, r, answers)) return 1;
  for (int i = 0; i < MC; ++i) r[i] = 0.0;
  for (int part = 0; part <= CONTINUATION_STEPS; ++part) {
    scale_friction(scene, cones, (double)part / CONTINUATION_STEPS);
    solved = sweep(scene, cones, r, sweeps[0], answers) || newton(scene, cones, r, answers);
  }
  return solved;
}
