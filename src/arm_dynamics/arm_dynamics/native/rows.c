/* SPDX-License-Identifier: Apache-2.0
 *
 * Inverse dynamics of many points in one call.
 *
 * Before this file: N (joints), INVERSE (name of the generated function), SZ_ARG, SZ_RES, SZ_IW, SZ_W (its work space).
 */

/* Answer `rows` points: torques for positions q, velocities v and accelerations a, N numbers a point, under gravity g[3]. */
__attribute__((visibility("default")))
void inverse_rows(const double* q, const double* v, const double* a, const double* g, long long rows, double* tau) {
  casadi_int iw[SZ_IW];
  real w[SZ_W];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  for (long long k = 0; k < rows; ++k) {
    arg[0] = q + k * N;
    arg[1] = v + k * N;
    arg[2] = a + k * N;
    arg[3] = g;
    res[0] = tau + k * N;
    INVERSE(arg, res, iw, w, 0);
  }
}
