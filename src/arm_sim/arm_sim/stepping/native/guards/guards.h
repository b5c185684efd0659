/* SPDX-License-Identifier: Apache-2.0
 *
 * All guards of a scene, see guard.h: their values, whether one may be crossed inside a step, and which is reached first.
 */

#pragma once
#include "guards/contact_guards.h"
#include "guards/friction_guards.h"
#include "guards/set_guards.h"
#include "guards/stop_guards.h"
#include "guards/switch_guards.h"

#define ARRIVAL_MARGIN 1.2          /* time at which a mode has certainly ended, as a multiple of the predicted one */

/* Guards of sets replace some that are before them. */
static const guard_law_t guard_laws[] = {
    {evaluate_contact_guards, contacts_may_cross, contact_arrival},
    {evaluate_friction_guards, friction_may_cross, friction_arrival},
    {evaluate_set_guards, set_may_cross, 0},
    {evaluate_stop_guards, stop_may_cross, stop_arrival},
    {evaluate_switch_guards, switch_may_cross, 0},
};
enum { GUARD_LAWS = sizeof guard_laws / sizeof guard_laws[0] };

/* The largest violation after a motion of length t in a segment. `near`: the loads at a state close by, which stand for those
 * at x if what is held is held firmly; or null. */
static double evaluate_guards(const scene_t* scene, const real* x, const segment_t* segment, const double* ground, double t,
                              const loads_t* near, guard_values_t* guards) {
  const memory_t* memory = segment->memory;
  guarded_t at = {x, segment, ground, t, memory->places_of_guards, memory->loads_of_guards, turning_rounding(scene, x)};
  const int is_firm = near && !segment->is_yielding && contacts_hold_firmly(scene, segment, near)
                      && joints_hold_firmly(scene, segment, near, x);
  fill(scene, guards, -INFINITY);
  if (any_travels(scene, segment)) find_geometry(scene, x, segment, &at.geometry);
  if (is_firm) at.loads = *near;
  else if (!all_moves(scene, segment->p.all)) find_loads(scene, x, segment, &at.loads);
  for (int i = 0; i < GUARD_LAWS; ++i) guard_laws[i].evaluate(scene, &at, guards);
  return max_of(guards->all, GUARD_VALUES);
}

/* Whether a mode may end inside a piece that satisfies all of them at both ends: also where loads on what is held vary inside
 * it, as they may with internal states and under error control, where pieces are long. */
static int may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  const piece_t* piece = &search->piece;
  const int long_or_lagging = scene->adaptive || NX > 2 * NU;
  if (!all_moves(scene, search->segment->p.all)
      && (long_or_lagging || !varies_evenly(scene, piece->begin, piece->end, piece->inside, piece->length)))
    return 1;
  for (int i = 0; i < GUARD_LAWS; ++i)
    if (guard_laws[i].may_cross(scene, search, end)) return 1;
  return 0;
}

/* Time by which the first mode has ended at constant accelerations, INFINITY if none ends: it shortens the search where
 * impacts follow one another. */
static double predicted_arrival(const scene_t* scene, const real* x, const segment_t* segment) {
  double soonest = INFINITY;
  real slope[NX];
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL(loads_t, loads, loads_of, LOADS);
  int any_apart = 0;
  for (int k = 0; k < NC; ++k) any_apart |= segment->p.contact[k].closed == 0.0;
  find_geometry(scene, x, segment, &geometry);
  if (any_apart) find_loads(scene, x, segment, &loads);
  find_slope(scene, x, segment, slope);
  const guarded_t at = {x, segment, 0, 0.0, geometry, loads, 0.0};
  for (int i = 0; i < GUARD_LAWS; ++i)
    if (guard_laws[i].arrival) soonest = fmin(soonest, guard_laws[i].arrival(scene, &at, slope));
  return ARRIVAL_MARGIN * soonest;
}
