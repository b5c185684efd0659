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

/* Torques at the share s of the segment that begins with the first of two rows. */
static void torques_at(int64_t n, const double* rows, double s, double* torques) {
  for (int64_t i = 0; i < n; ++i) torques[i] = rows[i] + s * (rows[n + i] - rows[i]);
}

void trajectory_sample(int64_t n, int64_t segments, const double* knots, const double* polynomials, const double* ends,
                       const double* torques, double t, double* motion) {
  const int after = t >= knots[segments];
  if (!torques) memset(motion + 3 * n, 0, 8 * n);
  if (after || t < 0.0) {
    memcpy(motion, ends + after * n, 8 * n);
    memset(motion + n, 0, 16 * n);
    if (torques) memcpy(motion + 3 * n, torques + after * segments * n, 8 * n);
    return;
  }
  const int64_t k = segment_of(segments, knots, t), size = 3 * n;
  const double s = (t - knots[k]) / (knots[k + 1] - knots[k]);
  const double* c = polynomials + 6 * size * k;
  if (torques) torques_at(n, torques + k * n, s, motion + 3 * n);
  for (int64_t i = 0; i < size; ++i) motion[i] = c[5 * size + i];
  for (int power = 4; power >= 0; --power)
    for (int64_t i = 0; i < size; ++i) motion[i] = motion[i] * s + c[power * size + i];
}
