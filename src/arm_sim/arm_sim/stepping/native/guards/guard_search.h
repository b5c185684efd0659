/* SPDX-License-Identifier: Apache-2.0
 *
 * Search for the first violation of a guard inside a piece of a motion, also where all are satisfied at its ends.
 */

#pragma once
#include "guards/guards.h"

#define VIOLATION_ROUNDING 1e-15       /* violation treated as rounding */
#define SEARCH_FACTOR 4.0 /* factor of the next trial, if no mode has ended by the time that was predicted */
#define GUARD_SAMPLES 4             /* parts of a step at whose ends modes are looked at where one may end inside it, ... */
#define SAMPLE_PHASE 3.0      /* ... and as many for every further phase of its waves, in [rad], ... */
#define MOST_GUARD_SAMPLES 64       /* ... but not more than these */
#define PEAK_MARGIN 0.6     /* error of the largest sample of a guard, relative to the second difference of samples ... */
#define PEAK_DOUBT 0.1      /* ... and of its value at a predicted maximum, relative to the differences ... */
#define PEAK_GAIN 1e-2      /* ... which falls by this factor with every prediction ... */
#define PEAK_TRIALS 8       /* ... of at most so many */
#define EARLIER 4           /* earlier events that are looked for before one that was found */

/* Whether all modes are satisfied at a time in the piece, by a step of that length. */
static double excess_at(const scene_t* scene, const search_t* search, double t, guard_values_t* guards) {
  LOCAL(piece_t, part, piece_of, PIECE);
  real error[2];
  search->segment->memory->work += scene->step_cost;
  copy(part.begin, search->piece.begin, NX);
  copy(part.inside, search->piece.inside, NX);
  copy(part.end, part.begin, NX);
  if (t == 0.0 || make_step(scene, search->segment, t, &part, error))
    return evaluate_guards(scene, part.end, search->segment, search->ground, search->piece.from + t, 0, guards);
  fill(scene, guards, INFINITY);
  return INFINITY;
}

static void guards_at(const void* context, double t, double* values) {
  const search_t* search = (const search_t*)context;
  const scene_t* scene = search->scene;
  guard_values_t guards = guard_values_of(scene, values);
  excess_at(scene, search, t, &guards);
}

/* Vertex of the parabola through three points, relative to the middle one; NAN if it has no maximum between them. */
static double vertex_of(const double* t, const double* f) {
  const double left = (f[1] - f[0]) / (t[1] - t[0]), right = (f[2] - f[1]) / (t[2] - t[1]);
  const double bend = (right - left) / (t[2] - t[0]), slope = left + bend * (t[1] - t[0]), way = -slope / (2.0 * bend);
  return bend < 0.0 && way >= t[0] - t[1] && way <= t[2] - t[1] ? way : NAN;
}

/* Search the maximum of a guard, which was predicted between three times: a time at which the guard is positive, or 0. */
static double peak_of(const scene_t* scene, const search_t* search, int guard, double* t, double* f, guard_values_t* guards) {
  double doubt = PEAK_DOUBT * (fabs(f[1] - f[0]) + fabs(f[1] - f[2]));
  for (int k = 0; k < PEAK_TRIALS; ++k, doubt *= PEAK_GAIN) {
    const double way = vertex_of(t, f), trial = t[1] + way;
    if (!(trial > t[0] && trial < t[2])) return 0.0;
    excess_at(scene, search, trial, guards);
    const double value = guards->contact[guard];
    if (value > 0.0) return value < INFINITY ? trial : 0.0;
    if (value < -doubt || trial == t[1]) return 0.0;
    const int later = trial > t[1], better = value >= f[1];
    const int moved = better ? (later ? 0 : 2) : (later ? 2 : 0); /* the end of the bracket that is replaced */
    t[moved] = better ? t[1] : trial;
    f[moved] = better ? f[1] : value;
    if (better) {
      t[1] = trial;
      f[1] = value;
    }
  }
  return 0.0;
}

/* A time inside a piece at which a mode is violated though it is satisfied at both ends; 0 if the motion shows none.
 *
 * Guards are sampled on the method's continuous output; where their samples have a maximum that may be positive, the motion
 * itself is evaluated there.
 */
static double find_crossing(const scene_t* scene, const search_t* search, const guard_values_t* end, guard_values_t* guards) {
  const piece_t* piece = &search->piece;
  if (!may_cross(scene, search, end)) return 0.0;
  double sample_numbers[3 * GUARD_VALUES];
  guard_values_t sample[3]; /* the last three */
  real x[NX];
  for (int k = 0; k < 3; ++k) sample[k] = guard_values_of(scene, sample_numbers + k * GUARD_VALUES);
  const double phase = phase_of(scene, piece->begin, piece->end), parts = GUARD_SAMPLES * (1.0 + floor(phase / SAMPLE_PHASE));
  const int samples = (int)fmin(parts, MOST_GUARD_SAMPLES);
  const double step = piece->length / samples;
  for (int k = 0; k <= samples; ++k) {
    guard_values_t* last = sample + k % 3;
    state_inside(scene, piece, (double)k / samples, x);
    if (k == samples) *last = *end;
    else evaluate_guards(scene, x, search->segment, search->ground, piece->from + k * step, 0, last);
    for (int guard = 0; k > 1 && guard < GUARD_VALUES; ++guard) {
      double t[3] = {(k - 2) * step, (k - 1) * step, k * step}, f[3];
      if (sample[(k + 2) % 3].contact[guard] == -INFINITY) continue; /* there is no such guard in these modes */
      for (int i = 0; i < 3; ++i) f[i] = sample[(k + 1 + i) % 3].contact[guard];
      const double bend = 2.0 * f[1] - f[0] - f[2];
      const double way = fmax(f[1], fmax(f[0], f[2])) + PEAK_MARGIN * bend > 0.0 ? vertex_of(t, f) : NAN;
      if (way != way) continue;
      const double crossing = peak_of(scene, search, guard, t, f, guards);
      if (crossing > 0.0) return crossing;
    }
  }
  return 0.0;
}

/* End a piece at the first violation of a mode in it, known at a time `known` with `guards`: its length, -1 if it cannot be
 * computed. `error` is that of its last step.
 */
static double end_at_event(const scene_t* scene, search_t* search, double known, guard_values_t* guards, real* error) {
  piece_t* piece = &search->piece;
  LOCAL(guard_values_t, early, guard_values_of, GUARD_VALUES);
  double room[4 * GUARD_VALUES];
  for (double near = find_next(scene, piece->begin, search->segment); near < known; near *= SEARCH_FACTOR) {
    if (!(excess_at(scene, search, near, &early) > 0.0)) continue;
    known = near;
    copy(guards->contact, early.contact, GUARD_VALUES);
  }
  for (int turn = 0; turn < EARLIER; ++turn) {
    const double length = first_positive(guards_at, search, GUARD_VALUES, known, guards->contact, VIOLATION_ROUNDING, room);
    if (!make_step(scene, search->segment, length, piece, error)) return -1.0;
    evaluate_guards(scene, piece->end, search->segment, search->ground, piece->from + length, 0, &early);
    known = find_crossing(scene, search, &early, guards);
    if (known == 0.0) return length;
  }
  return piece->length;
}

/* A time in a piece of length h, whose end may be out of reach, at which a mode is violated; 0 if all are satisfied. */
static double find_violation(const scene_t* scene, const search_t* search, double h, int reached, guard_values_t* guards) {
  const piece_t* piece = &search->piece;
  const loads_t* near = piece->nears ? &piece->near : 0;
  LOCAL(guard_values_t, peak, guard_values_of, GUARD_VALUES);
  if (!reached) fill(scene, guards, INFINITY);
  if (!reached || evaluate_guards(scene, piece->end, search->segment, search->ground, piece->from + h, near, guards) > 0.0)
    return h;
  const double known = find_crossing(scene, search, guards, &peak);
  if (known > 0.0) copy(guards->contact, peak.contact, GUARD_VALUES);
  return known;
}
