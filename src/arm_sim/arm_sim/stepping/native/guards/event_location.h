/* SPDX-License-Identifier: Apache-2.0
 *
 * Location of an event in time, to rounding.
 */

#pragma once
#include "scene.h"

#include <math.h>
#include <string.h>

#define MOST_TRIALS 200
#define INSTANT 2e-16 /* half of the tolerance of an instant, relative to the searched interval */
#define GROWTH 32.0   /* growth of the steps out of an interval where values are rounding */

static double largest_among(const double* values, int count) {
  double largest = -INFINITY;
  for (int i = 0; i < count; ++i) largest = fmax(largest, values[i]);
  return largest;
}

/* Zero of a value, as a fraction of the interval from x1 to x2: inverse quadratic interpolation where three values allow it,
 * else bisection (Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function
 * without using derivatives", Advances in Engineering Software 28, 1997).
 */
static double zero_between(double x1, double x2, double x3, double f1, double f2, double f3) {
  const double place = (x1 - x2) / (x3 - x2), height = (f1 - f2) / (f3 - f2);
  if (!(height * height < place && (1.0 - height) * (1.0 - height) < 1.0 - place)) return 0.5; /* also if one is infinite */
  return f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2);
}

/* First instant at which one of several values changes from not positive, as all are at 0, to positive, as one is at h,
 * where they are `at_h`; values up to `tolerance` are accepted as rounding.
 *
 * Zeros are predicted for each value that changes its sign, and the earliest is tried: each value is smooth, the largest of
 * them is not. At the result one is positive, and just before it none, up to rounding. If one is positive at 0 already, that
 * is the result. `room` is for 4 * count numbers.
 */
static double first_positive(void (*values_at)(const void*, double, double*), const void* context, int count, double h,
                             const double* at_h, double tolerance, double* room) {
  /* The last trial, the other end of the interval, and the one before them. */
  const size_t size = (size_t)count * sizeof(double);
  double *f1 = room, *f2 = f1 + count, *f3 = f2 + count, *value = f3 + count, x1 = h, x2 = 0.0, x3, part = 0.5, creep = 0.0;
  memcpy(f1, at_h, size);
  values_at(context, 0.0, f2);
  if (largest_among(f2, count) > 0.0) return INSTANT * h;
  for (int k = 0; k < MOST_TRIALS; ++k) {
    const double trial = x1 + part * (x2 - x1);
    values_at(context, trial, value);
    const double worst = largest_among(value, count);
    const int same = (worst > 0.0) == (largest_among(f1, count) > 0.0);
    x3 = same ? x1 : x2;
    memcpy(f3, same ? f1 : f2, size);
    if (!same) {
      x2 = x1;
      memcpy(f2, f1, size);
    }
    x1 = trial;
    memcpy(f1, value, size);
    const double least = INSTANT * h / fabs(x2 - x1);
    if (least > 0.5 || (worst > 0.0 && (worst <= tolerance || creep > 0.0))) break;
    double rising = -INFINITY; /* the earliest prediction of values that are positive at the other end */
    for (int i = 0; i < count; ++i)
      if (f2[i] > 0.0) rising = fmax(rising, f1[i]);
    creep = worst > 0.0 || rising < -tolerance ? 0.0 : creep > 0.0 ? GROWTH * creep : INSTANT * h;
    if (creep > 0.0) { /* interpolation is useless between values that are rounding */
      part = fmin(creep / fabs(x2 - x1), 0.5);
      continue;
    }
    const int ahead = x2 < x1; /* is 1 the later end */
    part = ahead ? 0.0 : 1.0;
    for (int i = 0; i < count; ++i) {
      if ((f1[i] > 0.0) == (f2[i] > 0.0)) continue;
      const double zero = zero_between(x1, x2, x3, f1[i], f2[i], f3[i]);
      part = ahead ? fmax(part, zero) : fmin(part, zero);
    }
    part = fmax(fmin(part, 1.0 - least), least);
  }
  return largest_among(f1, count) > 0.0 ? x1 : x2;
}
