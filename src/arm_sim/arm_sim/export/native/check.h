/* SPDX-License-Identifier: Apache-2.0
 *
 * Comparison of numbers with those that are expected, for the test program of an exported library.
 */
#pragma once
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Compare `count` results; prints the largest error, relative to the largest of the expected numbers or 1, and returns 1 if it
 * is more than `tolerance` or NaN, else 0. */
static int differs(const char* name, const double* results, const double* expected, int count, double tolerance) {
  double scale = 1.0, worst = 0.0;
  for (int i = 0; i < count; ++i) {
    const double error = fabs(results[i] - expected[i]);
    if (fabs(expected[i]) > scale) scale = fabs(expected[i]);
    if (error > worst || isnan(error)) worst = error; /* nothing is larger than NaN, which so remains */
  }
  const int wrong = !(worst <= tolerance * scale);
  printf("%-32s %.1e %s\n", name, worst / scale, wrong ? "WRONG" : "right");
  return wrong;
}
