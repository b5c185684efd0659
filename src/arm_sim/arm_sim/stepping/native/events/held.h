/* SPDX-License-Identifier: Apache-2.0
 *
 * Whether friction, constraints and contacts leave an arm no degree of freedom.
 */

#pragma once
#include "modes/segment_state.h"

#define REST_SPEED 1e-9          /* speed treated as rounding if all joints of an arm are held */
#define INDEPENDENT 1e-10  /* part of a row that must be left by those before it, for it to count for the rank */

/* Rank of a positive semidefinite matrix whose rows may be of very different size, by elimination with diagonal pivots. */
static int rank_of(const scene_t* scene, real* W) {
  double trace = 0.0, root[MC + 1];
  int count = 0;
  for (int i = 0; i < MC; ++i) trace += AT(W, MC, i, i);
  for (int i = 0; i < MC; ++i) root[i] = AT(W, MC, i, i) > IMMOBILE * trace ? 1.0 / sqrt(AT(W, MC, i, i)) : 0.0;
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) AT(W, MC, i, j) *= root[i] * root[j];
  for (; count < MC; ++count) {
    int k = 0;
    real row[MC + 1];
    for (int i = 1; i < MC; ++i)
      if (AT(W, MC, i, i) > AT(W, MC, k, k)) k = i;
    const real largest = AT(W, MC, k, k);
    if (!(largest > INDEPENDENT)) break;
    for (int i = 0; i < MC; ++i) row[i] = AT(W, MC, i, k);
    for (int i = 0; i < MC; ++i)
      for (int j = 0; j < MC; ++j) AT(W, MC, i, j) -= row[i] * row[j] / largest;
  }
  return count;
}

/* Whether friction, constraints and contacts leave no degree of freedom. */
static int is_held(const scene_t* scene, const real* x, const segment_t* segment) {
  if (largest_of(x + NU, NU) > REST_SPEED) return 0;
  LOCAL(inertia_t, inertia, inertia_of, INERTIA);
  int free = NU;
  for (int i = 0; i < ND; ++i) free -= segment->p.direction[i] == 0.0;
  if (scene->constrained) {
    real rank = 0.0;
    CALL(scene->bilateral, (x, segment->u, segment->p.tunable), (&rank, 0));
    free -= (int)(rank + 0.5);
  }
  if (free > MC) return 0;
  find_inertia(scene, x, segment, &inertia);
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) {
      const contact_mode_t *a = segment->p.contact + i / 3, *b = segment->p.contact + j / 3;
      AT(inertia.W, MC, i, j) *= a->closed * b->closed * (i % 3 ? a->sticks : 1.0) * (j % 3 ? b->sticks : 1.0);
    }
  return rank_of(scene, inertia.W) >= free;
}
