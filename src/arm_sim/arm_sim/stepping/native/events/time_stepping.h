/* SPDX-License-Identifier: Apache-2.0
 *
 * The rest of a tick whose events accumulate, by time-stepping.
 *
 * Modes are chosen at the beginning of a step, and violations are corrected at its end, without rebound, as in Moreau's scheme
 * (Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Eng. 177, 1999). That is of first order, and
 * reported.
 */

#pragma once
#include "events/segment_begin.h"
#include "events/segments.h"
#include "events/stopping.h"

#define LEAST_PART 1e-6   /* fraction of a motion below which none is made, where penetrations cannot be corrected */
#define LEAST_TIME 1e-6   /* time left, relative to that at first, that is rounding */
#define TIME_STEPS 4      /* steps into which the rest of a tick is divided */
#define SHORTER_STEPS 100 /* further steps of a linkage, whose joints may reach their stops or turn ever faster */
#define END_HALVINGS 50   /* bisections to find where a joint of a linkage reaches its stop or turns */
#define TRAVEL_LIMIT 1e6  /* longest motion of a joint in a step [rad] or [m] */

/* Correct penetrations of planes and stops, and stop joints that reversed although they should have come to rest. Velocities
 * into planes and stops are kept, since the impact that removes them accounts for their energy.
 */
static void correct_penetrations(const scene_t* scene, real* x, const segment_t* segment) {
  LOCAL_SEGMENT(closed, segment);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  real anchor[2 * NC + 1], v[NU];
  for (int i = 0; i < ND; ++i)
    if (reverses(scene, x, segment, i)) x[NU + i] = 0.0;
  copy(v, x + NU, NU);
  find_geometry(scene, x, segment, &geometry);
  find_anchors(scene, &geometry, anchor);
  for (int k = 0; k < NC; ++k)
    if (geometry.place[3 * k] < 0.0) closed.p.contact[k].closed = 1.0;
  for (int correction = 0; correction < CORRECTIONS; ++correction) {
    stop_at_limits(scene, x);
    for (int i = 0; i < ND; ++i)
      if (at_stop(scene, x, i)) closed.p.direction[i] = 0.0; /* a correction must not pass a stop */
    close_contacts(scene, x, &closed, anchor);
    if (correction > 0 && !is_inside(scene, x, segment)) break;
  }
  copy(x + NU, v, NU);
}

/* Limit the motion from x such that no point is inside a plane, where penetrations cannot be corrected. */
static void limit_penetration(const scene_t* scene, const real* x, const segment_t* segment, real* after) {
  real end[NU];
  double part = 1.0;
  copy(end, after, NU);
  while (part > 0.0 && is_inside(scene, after, segment)) {
    part = part > LEAST_PART ? 0.5 * part : 0.0;
    for (int i = 0; i < NU; ++i) after[i] = x[i] + part * (end[i] - x[i]);
  }
}

/* Whether a step takes a joint farther than any joint goes: an unstable method made its speed grow. */
static int exceeds_travel(const scene_t* scene, const piece_t* piece) {
  double farthest = 0.0;
  for (int i = 0; i < NU; ++i) farthest = fmax(farthest, fabs(piece->end[i] - piece->begin[i]));
  return farthest > TRAVEL_LIMIT;
}

/* Whether a joint is beyond its stop, or moves against its sliding direction. */
static int passes_end(const scene_t* scene, const real* x, const segment_t* segment) {
  LOCAL(guard_values_t, guards, guard_values_of, GUARD_VALUES);
  fill(scene, &guards, -INFINITY);
  const memory_t* memory = segment->memory;
  const guarded_t at = {x, segment, 0, 0.0, memory->places_of_guards, memory->loads_of_guards, 0.0};
  evaluate_stop_guards(scene, &at, &guards);
  return max_of(guards.stop, 2 * NU) > 0.0 || (ND && turns_back(scene, x, segment));
}

/* Shorten a step of a linkage that takes a joint beyond its stop or turns it back: NONE, or why that is not possible. The
 * joint cannot be stopped alone afterwards, since that would open the loops. `h` is the length, before and after. */
static enum trouble shorten(const scene_t* scene, const segment_t* segment, piece_t* piece, double* h) {
  double low = 0.0, high = *h;
  real error[2];
  if (!scene->constrained || !passes_end(scene, piece->end, segment)) return NONE;
  for (int k = 0; k < END_HALVINGS; ++k) {
    const double middle = 0.5 * (low + high);
    if (make_step(scene, segment, middle, piece, error) && !passes_end(scene, piece->end, segment)) low = middle;
    else high = middle;
  }
  copy(piece->end, piece->begin, NX);
  *h = low;
  return low == 0.0 || make_step(scene, segment, low, piece, error) ? NONE : NUMBERS;
}

/* The rest of a tick in a few steps of fixed length, in place; of a linkage also shorter ones, until a joint reaches a stop
 * or turns back. */
static enum trouble step_through(const scene_t* scene, real* x, segment_t* segment, double left, report_t* report) {
  long long losses = LOSS_LIMIT;
  double rest = left;
  const int step_limit = TIME_STEPS + (scene->constrained ? SHORTER_STEPS : 0);
  segment->time_step = left / TIME_STEPS;
  for (int k = 0; k < step_limit && rest > 0.0; ++k) {
    real after[NX], anchor[2 * NC + 1], error[2];
    LOCAL(piece_t, piece, piece_of, PIECE);
    const enum trouble trouble = begin_segment(scene, x, segment, left, &losses, report, anchor);
    if (trouble != NONE) return trouble;
    copy(piece.begin, x, NX);
    begin_piece(scene, segment, &piece);
    double h = scene->constrained ? fmin(segment->time_step, rest) : segment->time_step;
    if (!make_step(scene, segment, h, &piece, error) || exceeds_travel(scene, &piece)) return NUMBERS;
    if (shorten(scene, segment, &piece, &h) != NONE) return NUMBERS;
    rest -= h;
    copy(after, piece.end, NX);
    close_contacts(scene, after, segment, anchor);
    correct_penetrations(scene, after, segment);
    limit_penetration(scene, x, segment, after);
    copy(x, after, NX);
  }
  return rest > LEAST_TIME * left ? UNDETERMINED : NONE;
}
