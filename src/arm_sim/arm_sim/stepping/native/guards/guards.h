/* SPDX-License-Identifier: Apache-2.0
 *
 * All guards of a scene, see guard.h: their values, whether one may be crossed inside a step, and which is reached first.
 */

#pragma once
#include "guards/contact_guards.h"
#include "guards/event_location.h"
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

/* Whether loads and forces are so far from their guards that those of a state close by are within them. */
static int is_far_from_limits(const scene_t* scene, const segment_t* segment, const loads_t* near, const real* x) {
  double heaviest = 0.0;
  if (segment->yields) return 0;
  for (int k = 0; k < NC; ++k)
    if (segment->p.contact[k].closed != 0.0) heaviest = fmax(heaviest, near->force[3 * k]);
  for (int k = 0; k < NC; ++k) {
    const real* r = near->force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) continue;
    if (!(r[0] > 2.0 * NEAR * heaviest)) return 0;
    if (mode->sticks != 0.0 && !(hypot(r[1], r[2]) < (1.0 - 2.0 * NEAR) * stick_limit(scene, segment, k) * r[0])) return 0;
  }
  for (int i = 0; i < ND; ++i)
    if (segment->p.direction[i] == 0.0
        && (at_stop(scene, x, i) || !(fabs(near->load[i]) < (1.0 - 2.0 * NEAR) * scene->static_level[i])))
      return 0;
  return 1;
}

/* The largest violation after a motion of length t in a segment. `near`: the loads at a state close by, which are taken if what is
 * held is held firmly, or null. */
static double evaluate_guards(const scene_t* scene, const real* x, const segment_t* segment, const double* ground, double t,
                              const loads_t* near, guard_values_t* guards) {
  guarded_t at = {
      x, segment, ground, t, segment->memory->places_of_guards, segment->memory->loads_of_guards, turning_rounding(scene, x)};
  fill(scene, guards, -INFINITY);
  if (any_travels(scene, segment)) find_geometry(scene, x, segment, &at.geometry);
  if (near && is_far_from_limits(scene, segment, near, x)) at.loads = *near;
  else if (anything_held(scene, segment)) find_loads(scene, x, segment, &at.loads);
  for (int i = 0; i < GUARD_LAWS; ++i) guard_laws[i].evaluate(scene, &at, guards);
  return largest_among(guards->contact, GUARD_VALUES);
}

/* Whether a mode may end inside a piece that satisfies all of them at both ends: also where loads on what is held vary inside it,
 * as they may with internal states and under error control, where pieces are long. */
static int may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  const piece_t* piece = &search->piece;
  const int long_or_lagging = scene->adaptive || NX > 2 * NU;
  if (anything_held(scene, search->segment)
      && (long_or_lagging || !varies_evenly(scene, piece->begin, piece->end, piece->inside, piece->length)))
    return 1;
  for (int i = 0; i < GUARD_LAWS; ++i)
    if (guard_laws[i].may_cross(scene, search, end)) return 1;
  return 0;
}

/* Interval around the end of the first mode at constant accelerations: it shortens the search where impacts follow one another.
 * Infinite if no mode ends. */
static double find_next(const scene_t* scene, const real* x, const segment_t* segment) {
  double soonest = INFINITY;
  real slope[NX];
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL(loads_t, loads, loads_of, LOADS);
  int apart = 0;
  for (int k = 0; k < NC; ++k) apart |= segment->p.contact[k].closed == 0.0;
  find_geometry(scene, x, segment, &geometry);
  if (apart) find_loads(scene, x, segment, &loads);
  find_slope(scene, x, segment, slope);
  const guarded_t at = {x, segment, 0, 0.0, geometry, loads, 0.0};
  for (int i = 0; i < GUARD_LAWS; ++i)
    if (guard_laws[i].arrival) soonest = fmin(soonest, guard_laws[i].arrival(scene, &at, slope));
  return ARRIVAL_MARGIN * soonest;
}
