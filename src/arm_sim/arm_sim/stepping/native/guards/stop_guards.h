/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards of the joints' stops: positions beyond rigid ones, contact with compliant ones and separation from them.
 */

#pragma once
#include "modes/initial_modes.h"
#include "guards/guard.h"

static void evaluate_stop_guards(const scene_t* scene, const guarded_t* at, guard_values_t* guards) {
  const real* x = at->x;
  double overlap[2][NU], push[2][NU];
  for (int i = 0; scene->rigid && i < NU; ++i) {
    if (at->segment->p.direction[i] == 0.0) continue;
    const double room = SINKING * at->t + GAP_ROUNDING * (1.0 + fabs(x[i]));
    guards->stop[2 * i] = scene->rigid_stop[0][i] - x[i] - room;
    guards->stop[2 * i + 1] = x[i] - scene->rigid_stop[1][i] - room;
  }
  if (NQ) find_pressures(scene, x, overlap, push);
  for (int i = 0; i < NQ; ++i)
    for (int side = 0; side < 2; ++side)
      guards->pressed[2 * i + side] = at->segment->p.pressed[i] == (side ? 1.0 : -1.0) ? -push[side][i] : overlap[side][i];
}

/* Whether a joint may reach a stop; one with friction that does not turn, see friction_guards.h, meets it at most once. */
static int stop_may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  (void)end;
  for (int i = 0; i < NU; ++i) {
    double low, high;
    const int has_stop = scene->stop_place[0][i] > -DBL_MAX || scene->stop_place[1][i] < DBL_MAX;
    if (!has_stop || (ND && (search->segment->p.direction[i] == 0.0 || may_stick(scene, i)))) continue;
    find_bounds(scene, &search->piece, i, &low, &high);
    if (low <= scene->stop_place[0][i] || high >= scene->stop_place[1][i]) return 1;
  }
  return 0;
}

/* Time at which the first joint reaches a rigid stop. */
static double stop_arrival(const scene_t* scene, const guarded_t* at, const real* slope) {
  double soonest = INFINITY;
  for (int i = 0; scene->rigid && i < NU; ++i) {
    const double q = at->x[i], v = at->x[NU + i], a = slope[NU + i], below = GAP_ROUNDING * (1.0 + fabs(q));
    if (at->segment->p.direction[i] == 0.0) continue;
    soonest = fmin(soonest, fmin(time_to_cover(q - scene->rigid_stop[0][i] + below, -v, -a),
                                 time_to_cover(scene->rigid_stop[1][i] - q + below, v, a)));
  }
  return soonest;
}
