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

#define LEAST_PART 1e-6 /* fraction of a correction of penetrations below which it is not applied */
#define TIME_STEPS 4 /* steps into which the rest of a tick is divided */
#define SHORTER_STEPS 100 /* further ones of a linkage, whose joints may reach their stops or turn ever faster */
#define END_HALVINGS 50 /* bisections to find where they do */
#define MOST_TRAVEL 1e6 /* longest motion of a joint in such a step [rad] or [m] */

/* Correct penetrations of planes and stops, and stop joints that reversed although they should have come to rest. Velocities
 * into planes and stops are kept, since the impact that removes them accounts for their energy.
 */
static void correct_penetrations(const scene_t* scene, real* x, const segment_t* segment) {
  LOCAL_SEGMENT(caught, segment);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  real anchor[2 * NC + 1], v[NU];
  for (int i = 0; i < ND; ++i)
    if (may_stick(scene, i) && x[NU + i] * segment->p.direction[i] <= 0.0) x[NU + i] = 0.0;
  copy(v, x + NU, NU);
  find_geometry(scene, x, segment, &geometry);
  find_anchors(scene, &geometry, anchor);
  for (int k = 0; k < NC; ++k)
    if (geometry.place[3 * k] < 0.0) caught.p.contact[k].closed = 1.0;
  for (int turn = 0; turn < CORRECTIONS; ++turn) {
    stop_at_limits(scene, x);
    for (int i = 0; i < ND; ++i)
      if (at_stop(scene, x, i)) caught.p.direction[i] = 0.0; /* a correction must not pass a stop */
    close_contacts(scene, x, &caught, anchor);
    if (turn > 0 && !is_inside(scene, x, segment)) break;
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
  return farthest > MOST_TRAVEL;
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

/* Shorten a step that takes a joint beyond its stop or turns it back: its length, -1 if it cannot be computed. In a linkage
 * the joint cannot be stopped alone afterwards, since that would open the loops.
 */
static double shorten(const scene_t* scene, const segment_t* segment, double h, piece_t* piece) {
  double low = 0.0, high = h;
  real error[2];
  if (!scene->constrained || !passes_end(scene, piece->end, segment)) return h;
  for (int k = 0; k < END_HALVINGS; ++k) {
    const double middle = 0.5 * (low + high);
    if (make_step(scene, segment, middle, piece, error) && !passes_end(scene, piece->end, segment)) low = middle;
    else high = middle;
  }
  copy(piece->end, piece->begin, NX);
  return low == 0.0 || make_step(scene, segment, low, piece, error) ? low : -1.0;
}

/* The rest of a tick in a few steps of fixed length, in place; of a linkage also shorter ones, until a joint reaches a stop
 * or turns back. */
static enum trouble step_through(const scene_t* scene, real* x, segment_t* segment, double left, report_t* report) {
  long long losses = MOST_REBOUNDS;
  double rest = left;
  const int most_steps = TIME_STEPS + (scene->constrained ? SHORTER_STEPS : 0);
  segment->step = left / TIME_STEPS;
  for (int k = 0; k < most_steps && rest > 0.0; ++k) {
    real after[NX], anchor[2 * NC + 1], error[2];
    LOCAL(piece_t, piece, piece_of, PIECE);
    const enum trouble trouble = begin_segment(scene, x, segment, left, &losses, report, anchor);
    if (trouble != NONE) return trouble;
    copy(piece.begin, x, NX);
    begin_piece(scene, segment, &piece);
    const double h = scene->constrained ? fmin(segment->step, rest) : segment->step;
    if (!make_step(scene, segment, h, &piece, error) || exceeds_travel(scene, &piece)) return NUMBERS;
    const double length = shorten(scene, segment, h, &piece);
    if (length < 0.0) return NUMBERS;
    rest -= length;
    copy(after, piece.end, NX);
    close_contacts(scene, after, segment, anchor);
    correct_penetrations(scene, after, segment);
    limit_penetration(scene, x, segment, after);
    copy(x, after, NX);
  }
  return rest > LEAST_PART * left ? UNDETERMINED : NONE;
}
