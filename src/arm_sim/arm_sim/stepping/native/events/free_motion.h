/* SPDX-License-Identifier: Apache-2.0
 *
 * Motions of joints away from their stops, for which there are equations without modes.
 */

#pragma once
#include "guards/switch_guards.h"
#include "motion/stops.h"

/* Whether a drive or cord may switch in a motion to `next`: whether a comparison moves by half of its distance. */
static int may_switch(const scene_t* scene, const real* x, const real* u, const real* next) {
  if (!NK) return 0;
  real p[P_LENGTH + 1], begin[NK + 1], end[NK + 1], size[NK + 1];
  int any = 0;
  clear(p, P_LENGTH);
  CALL(scene->switches, (x, u, p), (begin, size));
  CALL(scene->switches, (next, u, p), (end, size));
  for (int k = 0; k < NK; ++k) {
    const double a = begin[k], b = end[k];
    any |= !(fabs(b - a) < 0.5 * fmin(fabs(a), fabs(b)) || (a == b && fabs(a) > SWITCH_ROUNDING * size[k]));
  }
  return any;
}

/* Whether a motion of length h stays free; or beforehand, where `next` is null, whether a step is worth trying: see
 * validity_t. */
static int stays_free(const scene_t* scene, const real* x, const real* u, const real* next, double h) {
  const real* end = next ? next : x;
  int meets = 0;
  for (int i = 0; i < NU; ++i) meets |= meets_stop(scene, x[i], x[NU + i], end[i], next ? next[NU + i] : 0.0, h, 0.0, i);
  return !meets && !(next && may_switch(scene, x, u, next));
}
