/* SPDX-License-Identifier: Apache-2.0
 *
 * The complementarity problem of forces or impulses of NC contacts with Coulomb friction.
 *
 * The unknowns are contact forces r, three numbers each (normal, two tangents), and motions w = W r + c with
 *
 *     0 <= r_n, 0 <= w_n, r_n w_n = 0,   |r_t| <= mu r_n,   r_t = -mu r_n w_t / |w_t| where w_t != 0.
 *
 * The same problem applies to accelerations and to velocities after an impact (Moreau, "Unilateral contact and dry
 * friction in finite freedom dynamics", CISM 302, 1988).
 */

#pragma once
#include "scene.h"

/* Entry of a matrix in CasADi's column-major order. */
#define AT(matrix, rows, i, j) ((matrix)[(i) + (rows) * (j)])

/* The problem of all contacts.
 *
 * W, c:              motion per force, and motion without forces
 * friction:          coefficients of sliding friction
 * static_friction:   coefficients of static friction
 * mu, mu_static:     parts of both coefficients in the current continuation step
 * sliding_direction: of contacts that slide already, two numbers each
 * was_sliding:       whether a contact slides already
 * is_touching:       whether a contact may transmit a force
 */
typedef struct {
  const double *W, *c, *friction, *static_friction;
  double *mu, *mu_static, *sliding_direction, *was_sliding, *is_touching;
} cones_t;
#define CONES (6 * NC)

static cones_t cones_of(const scene_t* scene, double* numbers) {
  cones_t cones = {0, 0, 0, 0, numbers, numbers + NC, numbers + 2 * NC, numbers + 4 * NC, numbers + 5 * NC};
  return cones;
}

/* The contact's own part of W. */
static void own_block(const scene_t* scene, const double* W, int k, double block[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) block[i][j] = AT(W, MC, 3 * k + i, 3 * k + j);
}

/* The trace of a contact's own part of W, a measure of its mobility. */
static double own_trace(const scene_t* scene, const double* W, int k) {
  return AT(W, MC, 3 * k, 3 * k) + AT(W, MC, 3 * k + 1, 3 * k + 1) + AT(W, MC, 3 * k + 2, 3 * k + 2);
}

/* Size of the forces of one contact: of its own, and of those that its motion without them demands. */
static double own_size(const scene_t* scene, const cones_t* cones, const double* r, int k) {
  double size = 0.0;
  for (int i = 3 * k; i < 3 * k + 3; ++i) {
    double demand = fabs(cones->c[i]);
    for (int j = 0; j < MC; ++j) demand += fabs(AT(cones->W, MC, i, j) * r[j]);
    size = fmax(size, fmax(fabs(r[i]), demand / own_trace(scene, cones->W, k)));
  }
  return size;
}
