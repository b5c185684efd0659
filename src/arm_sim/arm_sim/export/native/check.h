/* SPDX-License-Identifier: Apache-2.0
 *
 * Comparison of numbers with those that are expected, for the test program of an exported library.
 */
#pragma once
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Compare `count` numbers; prints the difference, relative to the largest of the expected numbers or 1, and returns 1 if it is
 * more than `most`, else 0. */
static int differs(const char* what, const double* got, const double* expected, int count, double most) {
  double largest = 1.0, difference = 0.0;
  for (int i = 0; i < count; ++i) {
    if (fabs(expected[i]) > largest) largest = fabs(expected[i]);
    const double apart = fabs(got[i] - expected[i]);
    if (!(apart <= difference)) difference = apart;
  }
  const int wrong = !(difference <= most * largest);
  printf("%-32s %.1e %s\n", what, difference / largest, wrong ? "WRONG" : "right");
  return wrong;
}
