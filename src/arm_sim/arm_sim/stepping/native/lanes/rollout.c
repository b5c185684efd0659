/* SPDX-License-Identifier: Apache-2.0
 *
 * Many arms, LANES at a time.
 */

#include "lanes/lanes.h"
#include "lanes/one_tick.h"

/* Advance the arms first … last-1.
 *
 * x0:   initial states, NX per arm.
 * tau:  torques; arm i, tick k at tau + i * tau_arm + k * tau_tick.
 * p:    parameters; arm i at p + i * p_arm.
 * out:  states of every tick, the first included, (ticks + 1) * NX per arm; if last_only, NX per arm.
 * met:  set to 1 for an arm that meets a stop; its states are invalid from there on.
 * effort: receives effective commands of every tick, ticks * NU per arm; or null.
 * engine: in a scene with events, that of one arm.
 * An arm that diverges is NaN from there on; other lanes are not affected.
 */
EXPORTED void rollout(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
                      long long p_arm, const double* h, long long ticks, long long first, long long last, double* out,
                      int last_only, signed char* met, double* effort, const engine_t* engine) {
  const long long row = last_only ? NX : (ticks + 1) * NX;
  const real length = h[0];
  for (long long arm = first; arm < last; arm += LANES) {
    real x[NX], next[NX], r[NR], acted[NU], par[NP + 1];
    long long of_lane[LANES];
    choose_arms(arm, last, of_lane);
    read_arms(x, NX, x0, NX, of_lane);
    read_arms(par, NP, p, p_arm, of_lane);
    for (long long k = 0; k <= ticks && !HALTED; ++k) {
      if (!last_only || k == ticks)
        for (int j = 0; j < LANES && arm + j < last; ++j)
          for (int i = 0; i < NX; ++i) out[(arm + j) * row + (last_only ? 0 : k * NX) + i] = LANE(x[i], j);
      if (k == ticks) break;
      if (k == 0 || tau_tick) read_arms(r, NR, tau + k * tau_tick, tau_arm, of_lane);
      make_tick(x, r, par, &length, last - arm < LANES ? (int)(last - arm) : LANES, engine, next, acted);
      for (int j = 0; effort && j < LANES && arm + j < last; ++j)
        for (int i = 0; i < NU; ++i) effort[((arm + j) * ticks + k) * NU + i] = LANE(acted[i], j);
      int lost = 0;
      for (int j = 0; j < LANES; ++j) met[of_lane[j]] |= meets_any_stop(x, next, h[0], j);
      for (int i = 0; i < NX; ++i) {
        x[i] = next[i];
        lost |= BEYOND(x[i], LARGEST);
      }
      for (int j = 0; lost && j < LANES; ++j)
        if (!within_reach(x, j))
          for (int i = 0; i < NX; ++i) LANE(x[i], j) = __builtin_nan("");
    }
  }
}
