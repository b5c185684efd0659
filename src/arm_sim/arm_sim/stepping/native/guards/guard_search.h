/* SPDX-License-Identifier: Apache-2.0
 *
 * Search for the first violation of a guard inside a piece of a motion, also where all are satisfied at its ends.
 */

#pragma once
#include "guards/event_location.h"
#include "guards/guards.h"

#define VIOLATION_ROUNDING 1e-15 /* violation treated as rounding */
#define SEARCH_FACTOR 4.0        /* factor of the next trial, if no mode has ended by the time that was predicted */
#define EARLIER_EVENTS 4                /* earlier events that are looked for before one that is known */

/* Samples of guards on the continuous output of a piece. */
#define GUARD_SAMPLES 4       /* parts of a piece at whose ends they are taken, ... */
#define SAMPLE_PHASE 3.0      /* ... and as many more for every further phase of its waves, in [rad] */
#define MOST_GUARD_SAMPLES 64

/* Search for the maximum of a guard. */
#define PEAK_MARGIN 0.6 /* error of the largest sample, relative to the second difference of samples */
#define PEAK_DOUBT 0.1  /* error of the first predicted maximum, relative to the differences of samples */
#define PEAK_GAIN 1e-2  /* factor by which the error falls with every prediction */
#define PEAK_TRIALS 8   /* predictions at most */

/* Largest guard at a time in the piece, to which a step of its own is made; INFINITY if it cannot be reached. */
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

/* The guards at a time in the piece, for first_positive. */
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

/* A time near the maximum of a guard, predicted between three times, at which it is positive; 0 if there is none. */
static double crossing_at_peak(const scene_t* scene, const search_t* search, int guard, double* t, double* f,
                               guard_values_t* guards) {
  double doubt = PEAK_DOUBT * (fabs(f[1] - f[0]) + fabs(f[1] - f[2]));
  for (int k = 0; k < PEAK_TRIALS; ++k, doubt *= PEAK_GAIN) {
    const double trial = t[1] + vertex_of(t, f);
    if (!(trial > t[0] && trial < t[2])) return 0.0;
    excess_at(scene, search, trial, guards);
    const double value = guards->all[guard];
    if (value > 0.0) return value < INFINITY ? trial : 0.0;
    if (value < -doubt || trial == t[1]) return 0.0;
    const int is_later = trial > t[1], is_higher = value >= f[1];
    const int replaced = is_higher == is_later ? 0 : 2; /* end of the bracket */
    t[replaced] = is_higher ? t[1] : trial;
    f[replaced] = is_higher ? f[1] : value;
    if (is_higher) {
      t[1] = trial;
      f[1] = value;
    }
  }
  return 0.0;
}

/* The same of any guard whose last three samples, of which the last is at k * step, have a maximum that may be positive. */
static double crossing_between(const scene_t* scene, const search_t* search, const guard_values_t* sample, int k, double step,
                               guard_values_t* guards) {
  for (int guard = 0; guard < GUARD_VALUES; ++guard) {
    double t[3] = {(k - 2) * step, (k - 1) * step, k * step}, f[3];
    for (int i = 0; i < 3; ++i) f[i] = sample[i].all[guard];
    if (f[1] == -INFINITY) continue; /* there is no such guard in these modes */
    const double bend = 2.0 * f[1] - f[0] - f[2], highest = fmax(f[1], fmax(f[0], f[2]));
    const double way = highest + PEAK_MARGIN * bend > 0.0 ? vertex_of(t, f) : NAN;
    if (way != way) continue; /* NaN: in C++, isnan is a function of its own */
    const double crossing = crossing_at_peak(scene, search, guard, t, f, guards);
    if (crossing > 0.0) return crossing;
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
  double numbers[3 * GUARD_VALUES];
  guard_values_t sample[3]; /* the last three */
  real x[NX];
  for (int i = 0; i < 3; ++i) sample[i] = guard_values_of(scene, numbers + i * GUARD_VALUES);
  const double phase = phase_of(scene, piece->begin, piece->end), parts = GUARD_SAMPLES * (1.0 + floor(phase / SAMPLE_PHASE));
  const int samples = (int)fmin(parts, MOST_GUARD_SAMPLES);
  const double step = piece->length / samples;
  for (int k = 0; k <= samples; ++k) {
    const guard_values_t oldest = sample[0];
    sample[0] = sample[1];
    sample[1] = sample[2];
    sample[2] = k < samples ? oldest : *end;
    if (k < samples) {
      state_inside(scene, piece, (double)k / samples, x);
      evaluate_guards(scene, x, search->segment, search->ground, piece->from + k * step, 0, sample + 2);
    }
    const double crossing = k > 1 ? crossing_between(scene, search, sample, k, step, guards) : 0.0;
    if (crossing > 0.0) return crossing;
  }
  return 0.0;
}

/* End a piece at the first violation of a mode in it, of which a later one is known, with its guards: its length, -1 if it
 * cannot be computed. `error` is that of its last step.
 */
static double end_at_event(const scene_t* scene, search_t* search, double later, guard_values_t* guards, real* error) {
  piece_t* piece = &search->piece;
  LOCAL(guard_values_t, early, guard_values_of, GUARD_VALUES);
  double room[4 * GUARD_VALUES];
  /* From the predicted arrival on, ever later: the first time at which a mode is violated. */
  const double arrival = predicted_arrival(scene, piece->begin, search->segment);
  for (double near = fmax(arrival, TIME_TOLERANCE * later); near < later; near *= SEARCH_FACTOR) {
    if (!(excess_at(scene, search, near, &early) > 0.0)) continue;
    later = near;
    copy(guards->all, early.all, GUARD_VALUES);
    break;
  }
  for (int turn = 0; turn < EARLIER_EVENTS; ++turn) {
    const double length = first_positive(guards_at, search, GUARD_VALUES, later, guards->all, VIOLATION_ROUNDING, room);
    if (!make_step(scene, search->segment, length, piece, error)) return -1.0;
    evaluate_guards(scene, piece->end, search->segment, search->ground, piece->from + length, 0, &early);
    later = find_crossing(scene, search, &early, guards);
    if (later == 0.0) return length;
  }
  return piece->length;
}

/* A time in a piece of length h, whose end may be out of reach, at which a mode is violated; 0 if all are satisfied. */
static double find_violation(const scene_t* scene, const search_t* search, double h, int reached, guard_values_t* guards) {
  const piece_t* piece = &search->piece;
  const loads_t* near = piece->has_near_loads ? &piece->near_loads : 0;
  LOCAL(guard_values_t, peak, guard_values_of, GUARD_VALUES);
  if (!reached) fill(scene, guards, INFINITY);
  if (!reached || evaluate_guards(scene, piece->end, search->segment, search->ground, piece->from + h, near, guards) > 0.0)
    return h;
  const double crossing = find_crossing(scene, search, guards, &peak);
  if (crossing > 0.0) copy(guards->all, peak.all, GUARD_VALUES);
  return crossing;
}
