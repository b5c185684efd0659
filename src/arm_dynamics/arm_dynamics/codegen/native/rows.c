/* SPDX-License-Identifier: Apache-2.0
 *
 * A function of vectors for many points in one call.
 *
 * Required definitions: POINT (name of the generated function), ARGUMENTS (number of its vectors), RESULTS (number of its
 * results), SIZES (numbers in each of these), SZ_ARG, SZ_RES, SZ_IW, SZ_W (its work space).
 */
#ifndef POINT /* read alone, as editors do */
#include "scalar.h"
#define casadi_int long long
#define POINT point
#define ARGUMENTS 3
#define RESULTS 1
#define SIZES 7
#define SZ_ARG 8
#define SZ_RES 8
#define SZ_IW 8
#define SZ_W 64
int point(const real** arg, real** res, casadi_int* iw, real* w, int mem);
#endif

/* Evaluate `rows` points: vector i of point k begins at arguments[i] + k * steps[i], result i at results[i] + k * its size. */
__attribute__((visibility("default"))) void answer_rows(const double* const* arguments, const long long* steps, long long rows,
                                                        double* const* results) {
  static const long long sizes[RESULTS] = {SIZES};
  casadi_int iw[SZ_IW];
  real w[SZ_W];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  for (long long k = 0; k < rows; ++k) {
    for (int i = 0; i < ARGUMENTS; ++i) arg[i] = arguments[i] + k * steps[i];
    for (int i = 0; i < RESULTS; ++i) res[i] = results[i] + k * sizes[i];
    POINT(arg, res, iw, w, 0);
  }
}
