/* SPDX-License-Identifier: Apache-2.0
 *
 * How friction turns the velocity of a sliding contact: which contacts creep, and over what length they can be followed.
 *
 * Let a contact slide at the speed s along e, with the acceleration a, the normal force lambda, and the mobility w across e.
 * Friction mu lambda is against its velocity, so a small speed d across e decays: d' = |e x a| - (mu lambda w / s) d, where
 * the lateral acceleration |e x a| is of what else acts across e. The speed d settles at the drift
 * |e x a| / (mu lambda w / s). The speed s decays at the deceleration rate max(-e . a, 0) / s, which together with
 * mu lambda w / s tells how fast the velocity changes: see turning_t.
 */

#pragma once
#include "events/closing.h"

#define TICK_PARTS 32   /* parts of a tick, whose length is the shortest over which the turn of a contact is followed */
#define TURN_ERROR 1e-8 /* error of a contact's velocity by a turn in a step of fixed length */

/* Speed of a contact across its direction, while it slides, that need not be followed. */
static double drift_tolerance(const scene_t* scene, const segment_t* segment) {
  return scene->adaptive ? 10.0 * segment->control->tolerance : TURN_ERROR;
}

/* Acceleration of a contact across a direction of sliding, per force across it. */
static double mobility_across(const scene_t* scene, const real* W, int k, const real* along) {
  double mobility = along[1] * along[1] * AT(W, MC, 3 * k + 1, 3 * k + 1);
  mobility += along[0] * along[0] * AT(W, MC, 3 * k + 2, 3 * k + 2);
  return mobility - 2.0 * along[1] * along[0] * AT(W, MC, 3 * k + 1, 3 * k + 2);
}

/* Find how friction turns each sliding contact at the beginning of a segment, unless that is known. */
static void find_turning(const scene_t* scene, const real* x, segment_t* segment) {
  if (segment->has_turning || !NC) return;
  LOCAL(loads_t, loads, loads_of, LOADS);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  int any = 0;
  segment->has_turning = 1;
  for (int k = 0; k < NC; ++k) {
    segment->turning[k].rate = 0.0;
    any |= scene->friction[k] > 0.0 && is_sliding(segment->p.contact + k);
  }
  if (!any) return;
  find_loads(scene, x, segment, &loads);
  find_geometry(scene, x, segment, &geometry);
  find_mobility(scene, x, segment, &mobility);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    const real *s = geometry.speed + n + 1, *a = loads.rate + n + 1, *along = segment->p.contact[k].along;
    turning_t* turning = segment->turning + k;
    if (!(scene->friction[k] > 0.0 && is_sliding(segment->p.contact + k))) continue;
    const double speed = fmax(hypot(s[0], s[1]), scene->slowest);
    const double rate = scene->friction[k] * loads.force[n] * mobility_across(scene, mobility.W, k, along) / speed;
    if (!(rate > 0.0)) continue;
    turning->deceleration_rate = fmax(-(along[0] * a[0] + along[1] * a[1]), 0.0) / speed;
    turning->rate = rate + turning->deceleration_rate;
    turning->lateral_acceleration = fabs(along[0] * a[1] - along[1] * a[0]);
    turning->drift = turning->lateral_acceleration / rate;
  }
}

/* Mark contacts that creep, which are treated as at rest: 1 if there are any.
 *
 * Such a contact turns too fast for an explicit method. If it does not lose speed and has settled in its direction, or in a
 * time-stepped tick whatever it does, it starts anew, in the direction in which it would start to slide from rest.
 */
static int mark_creeping_contacts(const scene_t* scene, const real* x, segment_t* segment, double tick) {
  int any = 0;
  find_turning(scene, x, segment);
  for (int k = 0; k < NC; ++k) {
    const turning_t* turning = segment->turning + k;
    const int has_settled = turning->deceleration_rate == 0.0 && turning->drift <= drift_tolerance(scene, segment);
    segment->contact[k].is_creeping = turning->rate > TICK_PARTS / tick && (has_settled || segment->time_step > 0.0);
    any |= segment->contact[k].is_creeping != 0.0;
  }
  return any;
}

/* Let contacts that move on a straight line keep their direction where they would turn within a part of the tick: the error of
 * their speed across it stays below the tolerance, or below the slowest speed where they stop within that part. */
static void fix_straight_contacts(const scene_t* scene, const real* x, segment_t* segment, double tick) {
  const double part = tick / TICK_PARTS;
  find_turning(scene, x, segment);
  for (int k = 0; k < NC; ++k) {
    const turning_t* turning = segment->turning + k;
    if (!(turning->rate > 0.0 && 1.0 / turning->rate < part)) continue;
    const int stops_within_part = turning->deceleration_rate * part > 1.0;
    const double tolerance =
        stops_within_part ? 0.5 * scene->slowest * turning->deceleration_rate : drift_tolerance(scene, segment) / part;
    if (turning->lateral_acceleration <= tolerance) segment->p.contact[k].fixed = 1.0;
  }
}

/* Longest segment over which sliding can be followed: with fixed steps, a part of the time in which friction turns a contact
 * that a method of order 4 resolves, whose error in a turn is that of exp(-t) in its Taylor series, t^5 / 120.
 */
static double find_reach(const scene_t* scene, const segment_t* segment, double tick) {
  double reach = tick;
  for (int k = 0; k < NC; ++k) {
    const turning_t* turning = segment->turning + k;
    if (!(turning->rate > 0.0)) continue;
    double length = 1.0 / turning->rate;
    if (segment->p.contact[k].fixed != 0.0) length = fmax(length, tick / TICK_PARTS);
    else if (!scene->adaptive) length *= fmin(1.0, pow(120.0 * TURN_ERROR / turning->drift, 0.2));
    reach = fmin(reach, length);
  }
  return reach;
}

/* Stop creeping contacts that move against the direction in which they would start from rest. */
static void stop_reversed_contacts(const scene_t* scene, real* x, const segment_t* segment) {
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  real anchor[2 * NC + 1];
  LOCAL_SEGMENT(stopped, segment);
  int any = 0;
  find_geometry(scene, x, segment, &geometry);
  find_anchors(scene, &geometry, anchor);
  for (int k = 0; k < NC; ++k) {
    const real* s = geometry.speed + 3 * k + 1;
    contact_mode_t* mode = stopped.p.contact + k;
    if (segment->contact[k].is_creeping == 0.0 || mode->closed == 0.0 || mode->along[0] * s[0] + mode->along[1] * s[1] > 0.0)
      continue;
    mode->sticks = 1.0;
    any = 1;
  }
  if (any) close_contacts(scene, x, &stopped, anchor);
}
