/* SPDX-License-Identifier: Apache-2.0
 *
 * A step of the method in a segment, with its dense output.
 */

#pragma once
#include "modes/evaluations.h"

/* A step of the method in a segment: states at both ends, and as its continuous output in `inside` x' at the beginning, x' at
 * the end, and the state in the middle, NX numbers each. */
typedef struct {
  real *begin, *end, *inside;
  loads_t near_loads; /* at the method's stage at the end, load and force alone */
  int has_near_loads; /* whether near_loads is known */
  double from;        /* time since the beginning of the segment */
  double length;      /* duration */
} piece_t;
#define PIECE (5 * NX + NEAR_LOADS)

static piece_t piece_of(const scene_t* scene, real* numbers) {
  real* near = numbers + 5 * NX;
  piece_t piece = {numbers, numbers + NX, numbers + 2 * NX, {near, near, near + NU, 0, 0, 0}, 0, 0.0, 0.0};
  return piece;
}

/* Find the slope at the beginning of a piece, which make_step needs; where nothing is held steps find it themselves. */
static void begin_piece(const scene_t* scene, const segment_t* segment, piece_t* piece) {
  if (scene->has_moving_equations && all_moves(scene, segment->p.all)) return;
  find_slope(scene, piece->begin, segment, piece->inside);
}

/* Make a step of length h from the beginning of a piece, after begin_piece: 1 if every number stayed finite. `error` receives
 * the scaled error and that of q, with an estimate. The step may be predicted.
 */
static int make_step(const scene_t* scene, const segment_t* segment, double h, piece_t* piece, real* error) {
  const prediction_t* prediction = segment->predicted;
  const real length = h;
  const int is_moving = scene->has_moving_equations && all_moves(scene, segment->p.all);
  real *inside = piece->inside, *slope = inside + NX, *middle = slope + NX;
  piece->length = h;
  if (is_predicted(scene, segment) && h == prediction->length && same(piece->begin, prediction->x, NX)) {
    copy(piece->end, prediction->after, NX);
    copy(piece->inside, prediction->inside, 3 * NX);
    copy(piece->near_loads.all, prediction->near_loads, NEAR_LOADS);
    piece->has_near_loads = prediction->has_near_loads != 0;
    return within_reach(scene, piece->end);
  }
  piece->has_near_loads = !is_moving && scene->has_near_loads && NEAR_LOADS_SERVE;
  if (is_moving && scene->adaptive)
    CALL(scene->moving_attempt, (piece->begin, segment->u, segment->p.all, &length),
         (piece->end, error, error + 1, inside, slope, middle));
  else if (is_moving)
    CALL(scene->moving_step, (piece->begin, segment->u, segment->p.all, &length), (piece->end, inside, slope, middle));
  else if (scene->adaptive)
    CALL(scene->attempt, (piece->begin, segment->u, segment->p.all, &length, inside),
         (piece->end, error, error + 1, slope, middle, piece->near_loads.load, piece->near_loads.force));
  else
    CALL(scene->step, (piece->begin, segment->u, segment->p.all, &length, inside),
         (piece->end, slope, middle, piece->near_loads.load, piece->near_loads.force));
  return within_reach(scene, piece->end);
}

/* The state at a fraction of a piece: the polynomial of degree 4 through its ends, their slopes and the middle. */
static void state_inside(const scene_t* scene, const piece_t* piece, double part, real* x) {
  const double h = piece->length, rest = 1.0 - part, a = rest * rest * (1.0 + 2.0 * part), bump = part * part * rest * rest;
  for (int i = 0; i < NX; ++i) {
    const double x0 = piece->begin[i], x1 = piece->end[i], f0 = piece->inside[i], f1 = piece->inside[NX + i];
    const double bend = piece->inside[2 * NX + i] - 0.5 * (x0 + x1) - 0.125 * h * (f0 - f1);
    x[i] = a * x0 + (1.0 - a) * x1 + h * part * rest * (rest * f0 - part * f1) + 16.0 * bump * bend;
  }
}
