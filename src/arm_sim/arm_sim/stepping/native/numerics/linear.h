/* SPDX-License-Identifier: Apache-2.0
 *
 * Linear equations.
 */

#pragma once
#include <math.h>

/* Solve A x = b for a row-major n by n matrix, both overwritten, by elimination with row pivots: 0 if A is singular. */
static int solve_linear(int n, double* A, double* b) {
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (fabs(A[n * i + k]) > fabs(A[n * pivot + k])) pivot = i;
    if (A[n * pivot + k] == 0.0) return 0;
    for (int j = k; j < n; ++j) {
      const double swapped = A[n * k + j];
      A[n * k + j] = A[n * pivot + j];
      A[n * pivot + j] = swapped;
    }
    const double swapped = b[k];
    b[k] = b[pivot];
    b[pivot] = swapped;
    for (int i = k + 1; i < n; ++i) {
      const double factor = A[n * i + k] / A[n * k + k];
      for (int j = k; j < n; ++j) A[n * i + j] -= factor * A[n * k + j];
      b[i] -= factor * b[k];
    }
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int j = i + 1; j < n; ++j) b[i] -= A[n * i + j] * b[j];
    b[i] /= A[n * i + i];
  }
  return 1;
}
