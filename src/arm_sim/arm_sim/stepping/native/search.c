/* SPDX-License-Identifier: Apache-2.0
 *
 * The instant at which something begins, to rounding.
 */

#include <math.h>

#define MOST_TRIALS 200
#define INSTANT 2e-16 /* half of what an instant may be off, as a part of the time searched */

/* Where a value changes from not positive, at 0, to positive, at h, where it is f_h; a value of up to `nothing` is good
 * enough, for it is rounding.
 *
 * Inverse quadratic interpolation where three values allow it, else bisection (Chandrupatla, "A new hybrid
 * quadratic/bisection algorithm for finding the zero of a nonlinear function without using derivatives", Advances in
 * Engineering Software 28, 1997). The value is positive at the answer, and just before it not, or nothing to speak of.
 */
static double first_positive(double (*value_at)(const void*, double), const void* asked, double h, double f_h,
                             double nothing) {
  /* The last trial, the other end of the interval, and the one before them. */
  double x1 = h, f1 = f_h, x2 = 0.0, f2 = value_at(asked, 0.0), x3, f3, part = 0.5;
  for (int k = 0; k < MOST_TRIALS; ++k) {
    const double trial = x1 + part * (x2 - x1), value = value_at(asked, trial);
    const int same = (value > 0.0) == (f1 > 0.0);
    x3 = same ? x1 : x2; f3 = same ? f1 : f2;
    if (!same) { x2 = x1; f2 = f1; }
    x1 = trial; f1 = value;
    const double least = INSTANT * h / fabs(x2 - x1);
    if (least > 0.5 || (f1 > 0.0 && f1 <= nothing)) break;
    const double place = (x1 - x2) / (x3 - x2), height = (f1 - f2) / (f3 - f2);
    part = 0.5; /* also where a value is infinite */
    if (height * height < place && (1.0 - height) * (1.0 - height) < 1.0 - place)
      part = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2);
    part = part > least ? part < 1.0 - least ? part : 1.0 - least : least;
  }
  return f1 > 0.0 ? x1 : x2;
}
