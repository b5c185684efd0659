/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards: comparisons of the laws that act in a mode, not positive while it lasts. Each is smooth in time within a segment.
 *
 * A law (contact, dry friction, stops, switches, sets that hold together) adds its guards by a file of its own, and by an
 * entry in the list of guards.h, by which all are evaluated, bounded inside steps, and predicted in one way.
 */

#pragma once
#include "guards/dense_step.h"
#include "guards/smoothness.h"

#define REVERSAL_ROUNDING 1e-13 /* relative speed in the wrong direction tolerated of a joint that begins to slide */
#define FIRM_MARGIN (2.0 * LIMIT_MARGIN) /* distance from a limit, relative to it, at which states close by are within it */
#define SINKING 1e-12     /* speed up to which an open contact is not treated as approaching */

/* Values of all guards: of contacts gaps, or normal and tangential forces; of joints friction, and both stops; of drives and
 * cords comparisons; of the sets that hold together the largest excess, in place of those of their parts. */
typedef struct {
  double *all, *contact, *joint, *stop, *pressed, *switched, *sets;
} guard_values_t;
#define GUARD_VALUES (2 * NC + ND + 2 * NU + 2 * NQ + NK + 1)

static guard_values_t guard_values_of(const scene_t* scene, double* numbers) {
  guard_values_t guards;
  guards.all = guards.contact = numbers;
  guards.joint = guards.contact + 2 * NC;
  guards.stop = guards.joint + ND;
  guards.pressed = guards.stop + 2 * NU;
  guards.switched = guards.pressed + 2 * NQ;
  guards.sets = guards.switched + NK;
  return guards;
}

/* Give all guards one value: INFINITY where a state cannot be reached, -INFINITY for none. */
static void fill(const scene_t* scene, guard_values_t* guards, double value) {
  for (int i = 0; i < GUARD_VALUES; ++i) guards->all[i] = value;
}

/* Two guards of a contact: its gap or normal force; its tangential force or speed. */
static double* normal_guard(const guard_values_t* guards, int k) { return guards->contact + 2 * k; }
static double* tangential_guard(const guard_values_t* guards, int k) { return guards->contact + 2 * k + 1; }

/* A state after a motion of length t in a segment, and what guards there depend on. */
typedef struct {
  const real* x;
  const segment_t* segment;
  const double* ground; /* gaps at the beginning of the segment that are negative by rounding */
  double t;
  geometry_t geometry; /* if a contact is apart or slides */
  loads_t loads; /* if anything is held */
  double rounding; /* speed against its direction that what slides may have */
} guarded_t;

/* A piece of a motion in which events are searched, and its segment; `ground` as of guarded_t. */
typedef struct {
  const scene_t* scene;
  piece_t piece;
  const segment_t* segment;
  double* ground;
} search_t;

/* The guards of a law. */
typedef struct {
  void (*evaluate)(const scene_t* scene, const guarded_t* at, guard_values_t* guards);
  /* Whether one may be positive inside a piece though none is at its ends; `end`: all values at its end. */
  int (*may_cross)(const scene_t* scene, const search_t* search, const guard_values_t* end);
  /* Time at which the first is zero if accelerations stay those of a state, INFINITY: never; null: not predicted. */
  double (*arrival)(const scene_t* scene, const guarded_t* at, const real* slope);
} guard_law_t;

/* Speed against its direction that a sliding joint may have by rounding. */
static double turning_rounding(const scene_t* scene, const real* x) { return REVERSAL_ROUNDING * (1.0 + max_abs(x + NU, NU)); }

/* Whether a contact is apart or slides: its place or speed may end its mode. */
static int any_travels(const scene_t* scene, const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed == 0.0 || segment->p.contact[k].sticks == 0.0;
  return any;
}

/* Time to cover the distance `way` at constant acceleration: INFINITY if never. */
static double time_to_cover(double way, double speed, double push) {
  const double square = speed * speed + 2.0 * push * way;
  if (square < 0.0) return INFINITY;
  const double root = sqrt(square), time = speed > 0.0 ? 2.0 * way / (speed + root) : (root - speed) / push;
  return time > 0.0 ? time : INFINITY;
}

/* Bounds of a number of the state inside a piece. */
static void find_bounds(const scene_t* scene, const piece_t* piece, int i, double* low, double* high) {
  bound_inside(scene, piece->begin, piece->end, piece->inside, piece->length, i, low, high);
}
