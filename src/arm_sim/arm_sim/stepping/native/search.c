/* SPDX-License-Identifier: Apache-2.0
 *
 * The instant at which something begins, to rounding.
 */

#include <math.h>

#define MOST_TRIALS 200

/* Where a value changes from not positive, at 0, to positive, at h, where it is f_h.
 *
 * Regula falsi with the weights of Illinois (Dowell, Jarratt, BIT 11, 1971) and a bisection in every fourth trial. The
 * value is positive at the answer and not just before it.
 */
static double first_positive(double (*value_at)(const void*, double), const void* asked, double h, double f_h) {
  double low = 0.0, high = h, f_low = value_at(asked, 0.0), f_high = f_h;
  int side = 0;
  for (int k = 0; k < MOST_TRIALS && high - low > 4e-16 * h; ++k) {
    const double secant = isfinite(f_high) ? high - f_high * (high - low) / (f_high - f_low) : low;
    const double trial = low < secant && secant < high && k % 4 != 3 ? secant : 0.5 * (low + high);
    const double value = value_at(asked, trial);
    if (value > 0.0) {
      high = trial; f_high = value;
      if (side > 0) f_low *= 0.5;
      side = 1;
    } else {
      low = trial; f_low = value;
      if (side < 0) f_high *= 0.5;
      side = -1;
    }
  }
  return high;
}
