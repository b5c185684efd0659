/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick with events will ask for if no event occurs, computed beforehand for several arms at a time.
 *
 * The engine of one arm looks its questions up here and computes those that are not answered, such as all that follow from
 * an event. Answers are those of the same functions for the same bits: the motion does not depend on what is predicted.
 */

#pragma once
#include "modes/geometry.h"
#include "modes/loads.h"

/* Whether loads at a step's last stage stand for those at its end: under error control they are the same, and without internal
 * states they do not swing within a step. */
#define NEAR_LOADS_SERVE (scene->adaptive || NX == 2 * NU)

#define LIMIT_MARGIN 0.1 /* distance to a limit at which it may be reached within a step, relative to the limit */

/* Bounds of a cubic by its Bernstein coefficients, from its ends and its slopes there. */
static inline void bound_cubic(real begin, real slope, real end, real end_slope, real h, real* low, real* high) {
  const real third = h / 3.0, b = begin + third * slope, c = end - third * end_slope;
  *low = fmin(fmin(begin, end), fmin(b, c));
  *high = fmax(fmax(begin, end), fmax(b, c));
}

/* Bounds of a number of the state inside a step of length h with its continuous output: those of the cubic through its ends,
 * widened by twice the distance of the cubic from the middle. */
static inline void bound_inside(const scene_t* scene, const real* x, const real* next, const real* inside, real h, int i,
                                real* low, real* high) {
  const real third = h / 3.0, a = third * inside[i], b = third * inside[NX + i];
  const real bend = 2.0 * fabs(inside[2 * NX + i] - 0.5 * (x[i] + next[i]) - 0.375 * (a - b));
  bound_cubic(x[i], inside[i], next[i], inside[NX + i], h, low, high);
  *low -= bend;
  *high += bend;
}

/* A predicted tick: what is given and known of it. An answer serves only a question with the same bits: NaN as modes or as
 * the end, which no question has, says that nothing is known there. The arrays are one after another.
 *
 * x, u, p:        beginning of the tick, its command, and its probable modes
 * length:         of the tick
 * geometry:       places of contacts at the beginning
 * anchor:         places of contacts in the tangents of their planes at the beginning
 * loads:          at the beginning
 * mobility:       at the beginning
 * after:          state at the end, with contacts as the step leaves them
 * geometry_after: places of contacts at the end
 * closed:         positions and velocities at the end with closed contacts
 * inside:         continuous output of the step: derivatives at both ends, and the state in the middle
 * near_loads:     loads and forces at the step's stage at its end
 * needs_...:      whether loads, mobility or closed contacts will be asked for
 * has_near_loads: whether near_loads is known
 */
typedef struct {
  double *x, *u, *p, length, *geometry, *anchor, *loads, *mobility;
  double *after, *geometry_after, *closed, *inside, *near_loads;
  int needs_loads, needs_mobility, needs_closing, has_near_loads;
} prediction_t;
#define PREDICTION (5 * NX + 3 * NU + P_LENGTH + 2 * PLACES + 2 * NC + LOADS + MOBILITY + NEAR_LOADS)

static inline prediction_t prediction_of(const scene_t* scene, double* numbers) {
  prediction_t tick;
  tick.x = numbers;
  tick.u = tick.x + NX;
  tick.p = tick.u + NU;
  tick.geometry = tick.p + P_LENGTH;
  tick.anchor = tick.geometry + PLACES;
  tick.loads = tick.anchor + 2 * NC;
  tick.mobility = tick.loads + LOADS;
  tick.after = tick.mobility + MOBILITY;
  tick.geometry_after = tick.after + NX;
  tick.closed = tick.geometry_after + PLACES;
  tick.inside = tick.closed + 2 * NU;
  tick.near_loads = tick.inside + 3 * NX;
  return tick;
}

/* Predictions for arms in lanes, one behind the other in an array. */
#define LOCAL_PREDICTIONS(name) \
  double name##_room[LANES * PREDICTION]; \
  prediction_t name[LANES]; \
  for (int lane = 0; lane < LANES; ++lane) name[lane] = prediction_of(scene, name##_room + lane * PREDICTION)

/* A tick without events, for derivatives: one smooth motion.
 *
 * p:           its modes
 * stick_limit: fraction of its normal force up to which a contact sticks
 * begin, end:  states at the ends of the motion
 * after:       state after the tick, with closed contacts
 */
typedef struct {
  double *p, *stick_limit, *begin, *end, *after;
} event_free_t;
#define EVENT_FREE (P_LENGTH + NC + 3 * NX)

static inline event_free_t event_free_of(const scene_t* scene, double* numbers) {
  double* begin = numbers + P_LENGTH + NC;
  event_free_t tick = {numbers, numbers + P_LENGTH, begin, begin + NX, begin + 2 * NX};
  return tick;
}

/* The engine of one arm: find the modes and the anchors of a tick from its beginning, and what will be asked for; make the
 * tick, return 0 if it cannot be computed; make a tick without events, return 0 if there is one. Python: Engine. */
typedef struct {
  const void* scene; /* of one arm: the first argument of each */
  void (*predict)(const void* scene, prediction_t* tick);
  int (*predicted_tick)(const void* scene, const prediction_t* tick, double* after);
  int (*event_free_tick)(const void* scene, const prediction_t* tick, event_free_t* result);
} engine_t;
