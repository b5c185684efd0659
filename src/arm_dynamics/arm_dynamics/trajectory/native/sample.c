/* SPDX-License-Identifier: Apache-2.0 */
#include "sample.h"

#include <string.h>

/* Index of the segment that contains a time within the motion. */
static int64_t segment_of(int64_t segments, const double* knots, double t) {
  int64_t low = 0, high = segments;
  while (high - low > 1) {
    const int64_t middle = (low + high) / 2;
    if (knots[middle] <= t) low = middle;
    else high = middle;
  }
  return low;
}

void sample(int64_t n, int64_t segments, const double* knots, const double* polynomials, const double* ends, double t,
            double* motion) {
  const int after = t >= knots[segments];
  if (after || t < 0.0) {
    memcpy(motion, ends + after * n, 8 * n);
    memset(motion + n, 0, 16 * n);
    return;
  }
  const int64_t k = segment_of(segments, knots, t), size = 3 * n;
  const double s = (t - knots[k]) / (knots[k + 1] - knots[k]);
  const double* c = polynomials + 6 * size * k;
  for (int64_t i = 0; i < size; ++i) motion[i] = c[5 * size + i];
  for (int power = 4; power >= 0; --power)
    for (int64_t i = 0; i < size; ++i) motion[i] = motion[i] * s + c[power * size + i];
}
