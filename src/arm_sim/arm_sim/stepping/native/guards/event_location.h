/* SPDX-License-Identifier: Apache-2.0
 *
 * Location of an event in time, to rounding: the first zero of one of several values.
 *
 * Each value is smooth, the largest of them is not: zeros are predicted for each that changes its sign, and the earliest is
 * tried. Where values are rounding, as of a joint that has just begun to move, predictions mean nothing: trials then creep
 * ahead in steps that grow.
 */

#pragma once
#include "numerics/vectors.h"

#define TRIAL_LIMIT 200
#define TIME_TOLERANCE 2e-16 /* half of the tolerance of an instant, relative to the searched interval */
#define CREEP_GROWTH 32.0 /* of the steps that creep */

/* The interval of the search: the last trial, its other end, and the trial before them; times, and values there. */
typedef struct {
  double x1, x2, x3;
  double *f1, *f2, *f3;
} bracket_t;

/* Let a trial replace the end of the interval that is on its side of the first zero. */
static void update_bracket(bracket_t* at, int count, double trial, const double* values) {
  const int is_on_same_side = (max_of(values, count) > 0.0) == (max_of(at->f1, count) > 0.0);
  at->x3 = is_on_same_side ? at->x1 : at->x2;
  copy(at->f3, is_on_same_side ? at->f1 : at->f2, count);
  if (!is_on_same_side) {
    at->x2 = at->x1;
    copy(at->f2, at->f1, count);
  }
  at->x1 = trial;
  copy(at->f1, values, count);
}

/* Zero of a value, as a fraction of the interval from x1 to x2: inverse quadratic interpolation where three values allow it,
 * else bisection (Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function
 * without using derivatives", Advances in Engineering Software 28, 1997).
 */
static double predicted_zero(const bracket_t* at, int i) {
  const double f1 = at->f1[i], f2 = at->f2[i], f3 = at->f3[i];
  const double place = (at->x1 - at->x2) / (at->x3 - at->x2), height = (f1 - f2) / (f3 - f2);
  if (!(height * height < place && (1.0 - height) * (1.0 - height) < 1.0 - place)) return 0.5; /* also if one is infinite */
  return f1 / (f2 - f1) * f3 / (f2 - f3) + (at->x3 - at->x1) / (at->x2 - at->x1) * f1 / (f3 - f1) * f2 / (f3 - f2);
}

/* The earliest of the predicted zeros, as a fraction of the interval. */
static double earliest_zero(const bracket_t* at, int count) {
  const int backwards = at->x2 < at->x1;
  double part = backwards ? 0.0 : 1.0;
  for (int i = 0; i < count; ++i) {
    if ((at->f1[i] > 0.0) == (at->f2[i] > 0.0)) continue;
    const double zero = predicted_zero(at, i);
    part = backwards ? fmax(part, zero) : fmin(part, zero);
  }
  return part;
}

/* Whether a value that is positive at the other end is rounding, or positive, at the last trial. */
static int is_rounding(const bracket_t* at, int count, double tolerance) {
  int any = 0;
  for (int i = 0; i < count; ++i) any |= at->f2[i] > 0.0 && at->f1[i] >= -tolerance;
  return any;
}

/* First instant at which one of several values changes from not positive, as all are at 0, to positive, as one is at h,
 * where they are `at_h`; values up to `tolerance` are accepted as rounding.
 *
 * At the result one is positive, and just before it none, up to rounding. If one is positive at 0 already, the result is the
 * first instant after it. `room` is for 4 * count numbers.
 */
static double first_positive(void (*values_at)(const void*, double, double*), const void* context, int count, double h,
                             const double* at_h, double tolerance, double* room) {
  bracket_t at = {h, 0.0, 0.0, room, room + count, room + 2 * count};
  double *values = room + 3 * count, part = 0.5, creep = 0.0;
  copy(at.f1, at_h, count);
  values_at(context, 0.0, at.f2);
  if (max_of(at.f2, count) > 0.0) return TIME_TOLERANCE * h;
  for (int k = 0; k < TRIAL_LIMIT; ++k) {
    const double trial = at.x1 + part * (at.x2 - at.x1);
    values_at(context, trial, values);
    update_bracket(&at, count, trial, values);
    const double worst = max_of(at.f1, count), width = fabs(at.x2 - at.x1), least = TIME_TOLERANCE * h / width;
    if (least > 0.5 || (worst > 0.0 && (worst <= tolerance || creep > 0.0))) break;
    if (worst > 0.0 || !is_rounding(&at, count, tolerance)) {
      creep = 0.0;
      part = fmax(fmin(earliest_zero(&at, count), 1.0 - least), least);
    } else {
      creep = creep > 0.0 ? CREEP_GROWTH * creep : TIME_TOLERANCE * h;
      part = fmin(creep / width, 0.5);
    }
  }
  return max_of(at.f1, count) > 0.0 ? at.x1 : at.x2;
}
