/* SPDX-License-Identifier: Apache-2.0
 *
 * Linear equations by elimination.
 */

#pragma once
#include <math.h>

#define DEPENDENCE_ROUNDING 1e-10 /* pivot of an elimination that is rounding, where all columns are of size 1 */

static void swap(double* a, double* b) {
  const double swapped = *a;
  *a = *b;
  *b = swapped;
}

/* Solve A x = b for a row-major n by n matrix, both overwritten, by elimination with row pivots: 0 if A is singular. */
static int solve_linear(int n, double* A, double* b) {
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (fabs(A[n * i + k]) > fabs(A[n * pivot + k])) pivot = i;
    if (A[n * pivot + k] == 0.0) return 0;
    for (int j = k; j < n; ++j) swap(A + n * k + j, A + n * pivot + j);
    swap(b + k, b + pivot);
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

/* Gauss-Jordan elimination with complete pivoting in columns from `begin` to before `end`. `basic` receives the column of each
 * row that gets a pivot; callers begin with -1 for all rows, and rows that have a column already are passed over. */
static void eliminate(int rows, int columns, double* T, int begin, int end, int* basic) {
  for (;;) {
    int row = -1, column = 0;
    double largest = DEPENDENCE_ROUNDING;
    for (int i = 0; i < rows; ++i)
      for (int j = begin; j < end && basic[i] < 0; ++j)
        if (fabs(T[columns * i + j]) > largest) {
          largest = fabs(T[columns * i + j]);
          row = i;
          column = j;
        }
    if (row < 0) return;
    basic[row] = column;
    const double pivot = T[columns * row + column];
    for (int j = 0; j < columns; ++j) T[columns * row + j] /= pivot;
    for (int i = 0; i < rows; ++i) {
      const double factor = T[columns * i + column];
      if (i == row || factor == 0.0) continue;
      for (int j = 0; j < columns; ++j) T[columns * i + j] -= factor * T[columns * row + j];
      T[columns * i + column] = 0.0;
    }
  }
}
