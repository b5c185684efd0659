/* SPDX-License-Identifier: Apache-2.0
 *
 * Comparison of numbers with those that are expected, for the test program of an exported library.
 */
#pragma once
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define MOST 1e-12 /* largest difference, relative to the largest of the expected numbers or 1 */

/* Compare `count` numbers; prints the difference and returns 1 if it is too large, else 0. */
static int differs(const char* what, const double* got, const double* expected, int count) {
  double largest = 1.0, difference = 0.0;
  for (int i = 0; i < count; ++i) {
    if (fabs(expected[i]) > largest) largest = fabs(expected[i]);
    if (!(fabs(got[i] - expected[i]) <= difference)) difference = fabs(got[i] - expected[i]);
  }
  const int wrong = !(difference <= MOST * largest);
  printf("%-32s %.1e %s\n", what, difference / largest, wrong ? "WRONG" : "right");
  return wrong;
}
