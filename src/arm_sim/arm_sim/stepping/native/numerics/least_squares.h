/* SPDX-License-Identifier: Apache-2.0
 *
 * Linear systems that may be singular: solutions of least squares and of the least norm.
 *
 * By one-sided Jacobi rotations (Hestenes, "Inversion of matrices by biorthogonalization and related results", J. SIAM 6,
 * 1958): columns of A are rotated until they are orthogonal, which gives its singular values.
 */

#pragma once
#include "scene.h"

#include <float.h>

#define SWEEPS 60

/* Rotate two columns by the angle of cosine c and sine s. */
static void rotate(int count, double c, double s, real* a, real* b) {
  for (int i = 0; i < count; ++i) {
    const double old = a[i];
    a[i] = c * old - s * b[i];
    b[i] = s * old + c * b[i];
  }
}

/* Make two columns orthogonal: 1 if they were not. */
static int make_orthogonal(int rows, int columns, real* a, real* b, real* va, real* vb) {
  const double aa = dot(a, a, rows), bb = dot(b, b, rows), ab = dot(a, b, rows);
  if (fabs(ab) <= DBL_EPSILON * sqrt(aa) * sqrt(bb)) return 0;
  const double zeta = (bb - aa) / (2.0 * ab), t = (zeta < 0.0 ? -1.0 : 1.0) / (fabs(zeta) + hypot(1.0, zeta));
  const double c = 1.0 / hypot(1.0, t), s = c * t;
  rotate(rows, c, s, a, b);
  rotate(columns, c, s, va, vb);
  return 1;
}

/* Solve A X = B for `count` columns. Matrices lie column by column; V is room for columns * columns numbers, A is changed. */
static void solve_least(int rows, int columns, real* A, real* V, int count, const real* B, real* X) {
  double largest_square = 0.0;
  for (int i = 0; i < columns * columns; ++i) V[i] = i % (columns + 1) == 0;
  for (int sweep = 0, any = 1; any && sweep < SWEEPS; ++sweep) {
    any = 0;
    for (int i = 0; i < columns; ++i)
      for (int j = i + 1; j < columns; ++j)
        any |= make_orthogonal(rows, columns, A + i * rows, A + j * rows, V + i * columns, V + j * columns);
  }
  for (int i = 0; i < columns * count; ++i) X[i] = 0.0;
  for (int i = 0; i < columns; ++i) largest_square = fmax(largest_square, dot(A + i * rows, A + i * rows, rows));
  const double rounding = DBL_EPSILON * (rows > columns ? rows : columns);
  for (int i = 0; i < columns; ++i) {
    const double square = dot(A + i * rows, A + i * rows, rows);
    if (!(square > rounding * rounding * largest_square)) continue;
    for (int k = 0; k < count; ++k) {
      const double share = dot(A + i * rows, B + k * rows, rows) / square;
      for (int j = 0; j < columns; ++j) X[k * columns + j] += share * V[i * columns + j];
    }
  }
}
