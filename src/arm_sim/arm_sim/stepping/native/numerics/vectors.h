/* SPDX-License-Identifier: Apache-2.0
 *
 * Arrays of numbers.
 */

#pragma once
#ifndef LANES
#include "scalar.h"
#endif
#include <float.h>
#include <math.h>
#include <string.h>

static inline void copy(real* __restrict to, const real* __restrict from, int count) {
  for (int i = 0; i < count; ++i) to[i] = from[i];
}

static inline void clear(real* numbers, int count) {
  for (int i = 0; i < count; ++i) numbers[i] = 0.0;
}

/* Whether numbers are the same, bit for bit. Without memcmp: exported code calls functions of mathematics alone. */
static inline int same(const double* a, const double* b, int count) {
  for (int i = 0; i < count; ++i) {
    long long bits[2];
    memcpy(bits, a + i, sizeof *a);
    memcpy(bits + 1, b + i, sizeof *b);
    if (bits[0] != bits[1]) return 0;
  }
  return 1;
}

static inline double dot(const double* a, const double* b, int count) {
  double sum = 0.0;
  for (int i = 0; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

static inline double max_abs(const double* values, int count) {
  double largest = 0.0;
  for (int i = 0; i < count; ++i)
    if (fabs(values[i]) > largest) largest = fabs(values[i]);
  return largest;
}

static inline double max_of(const double* values, int count) {
  double largest = -INFINITY;
  for (int i = 0; i < count; ++i)
    if (values[i] > largest) largest = values[i];
  return largest;
}
