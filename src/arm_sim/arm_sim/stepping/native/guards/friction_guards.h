/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards of dry friction of joints: torques of those that stick, directions of those that slide.
 */

#pragma once
#include "modes/modes.h"
#include "guards/guard.h"

static void evaluate_friction_guards(const scene_t* scene, const guarded_t* at, guard_values_t* guards) {
  const real *d = at->segment->p.direction, *v = at->x + NU;
  for (int i = 0; i < ND; ++i) {
    if (d[i] == 0.0) guards->joint[i] = joint_excess(scene, at->x, &at->loads, i);
    else if (may_stick(scene, i)) guards->joint[i] = -v[i] * d[i] - at->rounding;
  }
}

/* Whether the torques on all held joints are far from their limits, and no stop holds one. */
static int joints_hold_firmly(const scene_t* scene, const segment_t* segment, const loads_t* loads, const real* x) {
  for (int i = 0; i < ND; ++i) {
    if (segment->p.direction[i] != 0.0) continue;
    if (at_stop(scene, x, i) || !(fabs(loads->load[i]) < (1.0 - FIRM_MARGIN) * scene->static_level[i])) return 0;
  }
  return 1;
}

/* Whether the speed of a sliding joint may reach zero, or a torque is close to its limit at the end. */
static int friction_may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  const real* d = search->segment->p.direction;
  for (int i = 0; i < ND; ++i) {
    double low, high;
    if (d[i] == 0.0 && end->joint[i] > -LIMIT_MARGIN * scene->static_level[i]) return 1;
    if (d[i] == 0.0 || !may_stick(scene, i)) continue;
    find_bounds(scene, &search->piece, NU + i, &low, &high);
    if (d[i] > 0.0 ? low <= 0.0 : high >= 0.0) return 1;
  }
  return 0;
}

/* Time at which the first sliding joint comes to rest. */
static double friction_arrival(const scene_t* scene, const guarded_t* at, const real* slope) {
  double soonest = INFINITY;
  for (int i = 0; i < NU; ++i) {
    const double v = at->x[NU + i], a = slope[NU + i];
    if (may_stick(scene, i) && v * a < 0.0) soonest = fmin(soonest, -v / a);
  }
  return soonest;
}
