/* SPDX-License-Identifier: Apache-2.0
 *
 * Gradients of functions of the states of a rollout, LANES arms at a time. Only states at ticks are kept; the motion within
 * a tick is recomputed in the backward pass.
 */
#include "derivatives/adjoints.h"
#include "lanes/one_tick.h"

#include <string.h>

/* The arms first … last-1.
 *
 * x0, tau, p: as for rollout.                  g:    gradients by the states of every tick, the first included, NX per tick.
 * motion:     work space, (ticks + 1) * NX * LANES numbers.
 * by_x, by_tau, by_p: receive gradients, NX, ticks * NU and NP per arm.
 * met:        set to 1 for an arm that meets a stop or diverges; its gradients are invalid.
 */
EXPORTED void rollout_gradient(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
                               long long p_arm, const double* h, long long ticks, long long first, long long last,
                               const double* g, double* motion, double* by_x, double* by_tau, double* by_p, signed char* met) {
  const real length = h[0];
  for (long long arm = first; arm < last; arm += LANES) {
    real x[NX], next[NX], r[NU], u[NU], par[NP + 1], sum[NP + 1], weight[NX], back[NX], more[NX], of_u[NU], of_r[NU],
        of_p[NP + 1];
    long long of_lane[LANES];
    choose_arms(arm, last, of_lane);
    read_arms(x, NX, x0, NX, of_lane);
    read_arms(par, NP, p, p_arm, of_lane);
    memcpy(motion, x, sizeof x);
    for (long long k = 0; k < ticks && !HALTED; ++k) {
      read_arms(r, NU, tau + k * tau_tick, tau_arm, of_lane);
      make_tick(x, r, par, &length, LANES, 0, next, u);
      for (int j = 0; j < LANES; ++j) met[of_lane[j]] |= meets_any_stop(x, next, h[0], j);
      memcpy(x, next, sizeof x);
      memcpy(motion + (k + 1) * NX * LANES, x, sizeof x);
    }
    for (int j = 0; j < LANES; ++j) met[of_lane[j]] |= !within_reach(x, j);
    for (int i = 0; i < NP; ++i) sum[i] = 0.0;
    for (int i = 0; i < NX; ++i) weight[i] = 0.0;
    for (long long k = ticks; k >= 0 && !HALTED; --k) {
      for (int j = 0; j < LANES; ++j)
        for (int i = 0; i < NX; ++i) LANE(weight[i], j) += g[(of_lane[j] * (ticks + 1) + k) * NX + i];
      if (k == 0) break;
      memcpy(x, motion + (k - 1) * NX * LANES, sizeof x);
      read_arms(r, NU, tau + (k - 1) * tau_tick, tau_arm, of_lane);
      find_command(x, r, u);
      through_motion(x, u, par, &length, weight, back, of_u, of_p);
      through_command(x, r, of_u, more, of_r);
      for (int i = 0; i < NX; ++i) weight[i] = back[i] + more[i];
      for (int i = 0; i < NP; ++i) sum[i] += of_p[i];
      for (int j = 0; j < LANES && arm + j < last; ++j)
        for (int i = 0; i < NU; ++i) by_tau[((arm + j) * ticks + k - 1) * NU + i] = LANE(of_r[i], j);
    }
    for (int j = 0; j < LANES && arm + j < last; ++j) {
      for (int i = 0; i < NX; ++i) by_x[(arm + j) * NX + i] = LANE(weight[i], j);
      for (int i = 0; i < NP; ++i) by_p[(arm + j) * NP + i] = LANE(sum[i], j);
    }
  }
}
