/* SPDX-License-Identifier: Apache-2.0
 *
 * A function of vectors for many points in one call.
 *
 * Before this file: POINT (name of the generated function), ARGUMENTS (how many vectors it takes), ANSWER (numbers in its result),
 * SZ_ARG, SZ_RES, SZ_IW, SZ_W (its work space).
 */

/* Answer `rows` points: vector i of point k begins at given[i] + k * steps[i], its answer at made + k * ANSWER. */
__attribute__((visibility("default")))
void answer_rows(const double* const* given, const long long* steps, long long rows, double* made) {
  casadi_int iw[SZ_IW];
  real w[SZ_W];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  for (long long k = 0; k < rows; ++k) {
    for (int i = 0; i < ARGUMENTS; ++i) arg[i] = given[i] + k * steps[i];
    res[0] = made + k * ANSWER;
    POINT(arg, res, iw, w, 0);
  }
}
