/* SPDX-License-Identifier: Apache-2.0
 *
 * Linear problems over second-order cones: the least last unknown of y for which h + G y lies in a product of cones.
 *
 * A cone of one row is that of the numbers that are not negative; one of more rows is that of the vectors whose first number
 * is at least the length of the others, so that friction cones are exact. The method is a primal-dual interior-point method
 * with the scaling of Nesterov and Todd and a corrector (Andersen, Roos, Terlaky, "On implementing a primal-dual
 * interior-point method for conic quadratic optimization", Mathematical Programming 95, 2003), from a y inside the cones,
 * which no iterate leaves. The problems are small, and the normal equations dense.
 */

#pragma once
#include "scene.h"

/* The largest problem, of as many limits and reactions, self-stresses and parts as a scene has; see indeterminate.h. */
#define MOST_ROWS (3 * NU + 6 * NC + 1)
#define MOST_UNKNOWNS (NM + NU + 3 * NC + 1)
#define MOST_CONES (2 * NU + NC + 2)

#define CONIC_STEPS 80
#define CONIC_GAP 1e-13              /* duality gap at which the solution is reached */
#define CONIC_RESIDUAL 1e-7          /* error of the dual equations at which the solution is reached */
#define NORMAL_PIVOT_ROUNDING 1e-14  /* pivot of the normal equations that is rounding, relative to the diagonal */
#define EDGE_FRACTION 0.99           /* of the way to the nearest edge of a cone that a step goes */

/* h + G y is in cones of `size` rows each; G is stored row by row. */
typedef struct {
  int cones, rows, unknowns;
  int* size;
  double *h, *G;
} conic_t;

/* Square of a vector in the cone's form, without cancellation near its edge: positive inside. */
static double depth_in(const double* s, int n) {
  const double across = sqrt(dot(s + 1, s + 1, n - 1));
  return (s[0] - across) * (s[0] + across);
}

/* Scaling W of one cone with W z = W^-1 s: returns its factor, and fills its axis. */
static double find_scaling(const double* s, const double* z, int n, double* axis) {
  if (n == 1) return sqrt(s[0] / z[0]);
  const double of_s = depth_in(s, n), of_z = depth_in(z, n), root_s = sqrt(of_s), root_z = sqrt(of_z);
  const double twice = sqrt(2.0 * (1.0 + dot(s, z, n) / (root_s * root_z)));
  for (int i = 0; i < n; ++i) axis[i] = (s[i] / root_s + (i ? -1.0 : 1.0) * z[i] / root_z) / twice;
  return sqrt(root_s / root_z);
}

/* W x, or W^-1 x where `way` is -1. */
static void scale(double factor, const double* axis, const double* x, int n, int way, double* scaled) {
  const double by = way > 0 ? factor : 1.0 / factor, first = x[0];
  if (n == 1) {
    scaled[0] = by * first;
    return;
  }
  const double across = way * dot(axis + 1, x + 1, n - 1), turned = way * (first + across / (1.0 + axis[0]));
  scaled[0] = by * (axis[0] * first + across);
  for (int i = 1; i < n; ++i) scaled[i] = by * (x[i] + turned * axis[i]);
}

/* Solution x of a o x = r in the algebra of the cone. */
static void divide(const double* a, const double* r, int n, double* x) {
  x[0] = n == 1 ? r[0] / a[0] : (a[0] * r[0] - dot(a + 1, r + 1, n - 1)) / depth_in(a, n);
  for (int i = 1; i < n; ++i) x[i] = (r[i] - x[0] * a[i]) / a[0];
}

/* Largest length of a step d from s to the edge of the cone. */
static double room_to_edge(const double* s, const double* d, int n) {
  if (n == 1) return d[0] < 0.0 ? -s[0] / d[0] : INFINITY;
  const double b = s[0] * d[0] - dot(s + 1, d + 1, n - 1), c = depth_in(s, n), square = b * b - depth_in(d, n) * c;
  if (square < 0.0) return INFINITY;
  const double way = sqrt(square) - b;
  return way > 0.0 ? c / way : INFINITY;
}

/* The factor L of B^T B = L L^T, for m rows B of n columns; directions that these do not determine are left alone. */
static void factor_normal_matrix(int n, int m, const double* B, double* L) {
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) {
      L[n * i + j] = 0.0;
      for (int l = 0; l < m; ++l) L[n * i + j] += B[n * l + i] * B[n * l + j];
    }
  for (int k = 0; k < n; ++k) {
    const double diagonal = L[n * k + k];
    for (int j = 0; j < k; ++j) L[n * k + k] -= L[n * k + j] * L[n * k + j];
    L[n * k + k] = L[n * k + k] > NORMAL_PIVOT_ROUNDING * diagonal ? sqrt(L[n * k + k]) : INFINITY;
    for (int i = k + 1; i < n; ++i) {
      for (int j = 0; j < k; ++j) L[n * i + k] -= L[n * i + j] * L[n * k + j];
      L[n * i + k] /= L[n * k + k];
    }
  }
}

/* Solve L L^T x = b in place. */
static void solve_factored(int n, const double* L, double* b) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) b[i] -= L[n * i + j] * b[j];
    b[i] /= L[n * i + i];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int j = i + 1; j < n; ++j) b[i] -= L[n * j + i] * b[j];
    b[i] /= L[n * i + i];
  }
}

/* s = h + G y. */
static void find_slack(const conic_t* at, const double* y, double* s) {
  for (int i = 0; i < at->rows; ++i) s[i] = at->h[i] + dot(at->G + at->unknowns * i, y, at->unknowns);
}

/* Whether every part of s is inside its cone. */
static int is_within(const conic_t* at, const double* s) {
  int within = 1;
  for (int k = 0; k < at->cones; s += at->size[k++])
    within &= s[0] > 0.0 && (at->size[k] == 1 || depth_in(s, at->size[k]) > 0.0);
  return within;
}

/* Direction in y, and in the scaled s and z, in which s o z changes by `change` and the dual equations are satisfied, of
 * scaled rows B whose normal equations have the factor L. */
static void find_direction(const conic_t* at, const double* B, const double* L, const double* lambda, const double* change,
                           const double* residual, double* dy, double* ds, double* dz) {
  const int n = at->unknowns;
  for (int k = 0, i = 0; k < at->cones; i += at->size[k++]) divide(lambda + i, change + i, at->size[k], dz + i);
  for (int j = 0; j < n; ++j) {
    dy[j] = -residual[j];
    for (int i = 0; i < at->rows; ++i) dy[j] += B[n * i + j] * dz[i];
  }
  solve_factored(n, L, dy);
  for (int i = 0; i < at->rows; ++i) {
    ds[i] = dot(B + n * i, dy, n);
    dz[i] -= ds[i];
  }
}

/* Longest step, at most 1, that keeps s and z in their cones. */
static double step_to_edge(const conic_t* at, const double* lambda, const double* ds, const double* dz, double part) {
  double length = INFINITY;
  for (int k = 0, i = 0; k < at->cones; i += at->size[k++]) {
    length = fmin(length, room_to_edge(lambda + i, ds + i, at->size[k]));
    length = fmin(length, room_to_edge(lambda + i, dz + i, at->size[k]));
  }
  return fmin(1.0, part * length);
}

/* Change of s o z for the next step: to `target` on the central path, less the product of the predictor's changes. */
static void find_change(const conic_t* at, const double* lambda, const double* ds, const double* dz, double target,
                        double* change) {
  for (int k = 0, i = 0; k < at->cones; i += at->size[k++]) {
    const int n = at->size[k];
    change[i] = target - dot(lambda + i, lambda + i, n) - dot(ds + i, dz + i, n);
    for (int j = i + 1; j < i + n; ++j) change[j] = -2.0 * lambda[i] * lambda[j] - ds[i] * dz[j] - dz[i] * ds[j];
  }
}

/* Errors of the dual equations at z: returns the largest. */
static double dual_residual(const conic_t* at, const double* z, double* residual) {
  const int n = at->unknowns;
  double worst = 0.0;
  for (int j = 0; j < n; ++j) {
    residual[j] = j == n - 1;
    for (int i = 0; i < at->rows; ++i) residual[j] -= at->G[n * i + j] * z[i];
    worst = fmax(worst, fabs(residual[j]));
  }
  return worst;
}

/* Least last number of y, which begins inside the cones; no less than `goal` is searched for. z receives the dual solution. */
static double least_last(const scene_t* scene, const conic_t* at, double* y, double* z, double goal) {
  const int n = at->unknowns, m = at->rows;
  double s[MOST_ROWS], lambda[MOST_ROWS], axis[MOST_ROWS], ds[MOST_ROWS], dz[MOST_ROWS], change[MOST_ROWS];
  double residual[MOST_UNKNOWNS], dy[MOST_UNKNOWNS], next[MOST_UNKNOWNS], factor[MOST_CONES];
  double B[MOST_ROWS * MOST_UNKNOWNS], L[MOST_UNKNOWNS * MOST_UNKNOWNS];
  find_slack(at, y, s);
  for (int k = 0, i = 0; k < at->cones; i += at->size[k++])
    for (int j = 0; j < at->size[k]; ++j) z[i + j] = j ? 0.0 : 1.0 / at->cones;
  for (int step = 0; step < CONIC_STEPS && y[n - 1] > goal; ++step) {
    const double gap = dot(s, z, m), worst = dual_residual(at, z, residual);
    if (gap <= CONIC_GAP && worst <= CONIC_RESIDUAL) break;
    for (int k = 0, i = 0; k < at->cones; i += at->size[k++]) {
      const int rows = at->size[k];
      factor[k] = find_scaling(s + i, z + i, rows, axis + i);
      scale(factor[k], axis + i, z + i, rows, 1, lambda + i);
      for (int j = 0; j < n; ++j) {
        double column[MOST_ROWS];
        for (int l = 0; l < rows; ++l) column[l] = at->G[n * (i + l) + j];
        scale(factor[k], axis + i, column, rows, -1, column);
        for (int l = 0; l < rows; ++l) B[n * (i + l) + j] = column[l];
      }
    }
    factor_normal_matrix(n, m, B, L);
    for (int i = 0; i < m; ++i) ds[i] = dz[i] = 0.0;
    find_change(at, lambda, ds, dz, 0.0, change);
    find_direction(at, B, L, lambda, change, residual, dy, ds, dz);
    const double missing = 1.0 - step_to_edge(at, lambda, ds, dz, 1.0);
    find_change(at, lambda, ds, dz, missing * missing * missing * gap / at->cones, change);
    find_direction(at, B, L, lambda, change, residual, dy, ds, dz);
    const double length = step_to_edge(at, lambda, ds, dz, EDGE_FRACTION);
    for (int j = 0; j < n; ++j) next[j] = y[j] + length * dy[j];
    find_slack(at, next, s);
    if (!is_within(at, s)) break;
    for (int j = 0; j < n; ++j) y[j] = next[j];
    for (int k = 0, i = 0; k < at->cones; i += at->size[k++]) {
      scale(factor[k], axis + i, dz + i, at->size[k], -1, dz + i);
      for (int j = i; j < i + at->size[k]; ++j) z[j] += length * dz[j];
    }
  }
  return y[n - 1];
}
