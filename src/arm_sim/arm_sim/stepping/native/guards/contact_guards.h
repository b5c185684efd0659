/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards of contacts: gaps of open ones, normal forces and friction cones of closed ones, speeds of sliding ones.
 */

#pragma once
#include "modes/modes.h"
#include "guards/guard.h"

#define SPEED_RATIO 0.25         /* ratio of the speeds of a sliding contact at its ends */

static void evaluate_contact_guards(const scene_t* scene, const guarded_t* at, guard_values_t* guards) {
  for (int k = 0; k < NC; ++k) {
    const real *r = at->loads.force + 3 * k, *s = at->geometry.speed + 3 * k;
    const contact_mode_t* mode = at->segment->p.contact + k;
    if (mode->closed == 0.0) {
      *normal_guard(guards, k) =
          at->ground[k] - at->geometry.place[3 * k] - SINKING * at->t - GAP_ROUNDING * at->geometry.size[k];
      continue;
    }
    *normal_guard(guards, k) = -r[0];
    if (mode->sticks != 0.0) *tangential_guard(guards, k) = hypot(r[1], r[2]) - stick_limit(scene, at->segment, k) * r[0];
    else if (scene->static_friction[k] > 0.0)
      *tangential_guard(guards, k) = -(mode->along[0] * s[1] + mode->along[1] * s[2]) - at->rounding;
  }
}

/* Whether an open contact may touch, or a sliding one come to rest. */
static int travel_may_cross(const scene_t* scene, const segment_t* segment, const geometry_t* begin, const geometry_t* end,
                            double h, int k) {
  const contact_mode_t* mode = segment->p.contact + k;
  const real *s0 = begin->speed + 3 * k, *s1 = end->speed + 3 * k;
  if (mode->closed == 0.0) {
    double low, high;
    bound_cubic(begin->place[3 * k], s0[0], end->place[3 * k], s1[0], h, &low, &high);
    return low <= LIMIT_MARGIN * (high - low);
  }
  if (mode->sticks != 0.0 || !(scene->static_friction[k] > 0.0)) return 0;
  const double ahead0 = mode->along[0] * s0[1] + mode->along[1] * s0[2],
               ahead1 = mode->along[0] * s1[1] + mode->along[1] * s1[2];
  return fmin(ahead0, ahead1) <= SPEED_RATIO * fmax(ahead0, ahead1);
}

/* Whether a force is close to its limit at the end of a piece. */
static int force_may_cross(const scene_t* scene, const segment_t* segment, const guard_values_t* end, int k) {
  const contact_mode_t* mode = segment->p.contact + k;
  const double push = -*normal_guard(end, k);
  if (mode->closed == 0.0) return 0;
  for (int l = 0; l < NC; ++l)
    if (segment->p.contact[l].closed != 0.0 && push < -LIMIT_MARGIN * *normal_guard(end, l)) return 1;
  return mode->sticks != 0.0 && scene->static_friction[k] > 0.0
         && *tangential_guard(end, k) > -LIMIT_MARGIN * stick_limit(scene, segment, k) * push;
}

/* Whether the forces of all closed contacts are far from their limits. */
static int contacts_hold_firmly(const scene_t* scene, const segment_t* segment, const loads_t* loads) {
  double heaviest = 0.0;
  for (int k = 0; k < NC; ++k)
    if (segment->p.contact[k].closed != 0.0) heaviest = fmax(heaviest, loads->force[3 * k]);
  for (int k = 0; k < NC; ++k) {
    const real* r = loads->force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) continue;
    if (!(r[0] > FIRM_MARGIN * heaviest)) return 0;
    if (mode->sticks != 0.0 && !(hypot(r[1], r[2]) < (1.0 - FIRM_MARGIN) * stick_limit(scene, segment, k) * r[0])) return 0;
  }
  return 1;
}

/* Whether a contact may touch, slip, open or come to rest inside a piece. */
static int contacts_may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  const piece_t* piece = &search->piece;
  const segment_t* segment = search->segment;
  for (int k = 0; k < NC; ++k)
    if (force_may_cross(scene, segment, end, k)) return 1;
  if (!any_travels(scene, segment)) return 0;
  LOCAL(geometry_t, first, geometry_of, PLACES);
  LOCAL(geometry_t, last, geometry_of, PLACES);
  find_geometry(scene, piece->begin, segment, &first);
  find_geometry(scene, piece->end, segment, &last);
  for (int k = 0; k < NC; ++k)
    if (travel_may_cross(scene, segment, &first, &last, piece->length, k)) return 1;
  return 0;
}

/* Time at which the first open contact touches. */
static double contact_arrival(const scene_t* scene, const guarded_t* at, const real* slope) {
  double soonest = INFINITY;
  (void)slope;
  for (int k = 0; k < NC; ++k) {
    const double gap = fmax(at->geometry.place[3 * k], 0.0) + GAP_ROUNDING * at->geometry.size[k];
    if (at->segment->p.contact[k].closed == 0.0)
      soonest = fmin(soonest, time_to_cover(gap, -at->geometry.speed[3 * k], -at->loads.rate[3 * k]));
  }
  return soonest;
}
