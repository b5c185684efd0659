/* SPDX-License-Identifier: Apache-2.0
 *
 * Whether friction, constraints and contacts leave an arm no degree of freedom.
 */

#pragma once
#include "modes/evaluations.h"

#define REST_SPEED 1e-9          /* speed treated as rounding if all joints of an arm are held */

/* Rank of a positive semidefinite matrix whose rows may be of very different size; W is overwritten. */
static int rank_of(const scene_t* scene, real* W) {
  double trace = 0.0, root[MC + 1];
  int basic[MC + 1], count = 0;
  for (int i = 0; i < MC; ++i) trace += AT(W, MC, i, i);
  for (int i = 0; i < MC; ++i) root[i] = AT(W, MC, i, i) > IMMOBILE * trace ? 1.0 / sqrt(AT(W, MC, i, i)) : 0.0;
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) AT(W, MC, i, j) *= root[i] * root[j];
  for (int i = 0; i < MC; ++i) basic[i] = -1;
  eliminate(MC, MC, W, 0, MC, basic);
  for (int i = 0; i < MC; ++i) count += basic[i] >= 0;
  return count;
}

/* Whether an arm is held completely. No degree of freedom is counted twice: the rank of constraints is that of the joints that
 * slide, and the mobility of contacts that which both leave. */
static int is_immobile(const scene_t* scene, const real* x, const segment_t* segment) {
  if (max_abs(x + NU, NU) > REST_SPEED) return 0;
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  int free = NU;
  for (int i = 0; i < ND; ++i) free -= segment->p.direction[i] == 0.0;
  if (scene->constrained) {
    real rank = 0.0;
    CALL(scene->bilateral, (x, segment->u, segment->p.all), (&rank, 0));
    free -= (int)(rank + 0.5);
  }
  if (free > MC) return 0;
  find_mobility(scene, x, segment, &mobility);
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) {
      const contact_mode_t *a = segment->p.contact + i / 3, *b = segment->p.contact + j / 3;
      AT(mobility.W, MC, i, j) *= a->closed * b->closed * (i % 3 ? a->sticks : 1.0) * (j % 3 ? b->sticks : 1.0);
    }
  return rank_of(scene, mobility.W) >= free;
}
