/* SPDX-License-Identifier: Apache-2.0
 *
 * Many arms, LANES at a time.
 */

#include "lanes/lanes.h"
#include "lanes/one_tick.h"

/* Make the states of arms that have diverged NaN. */
static void invalidate_diverged(const scene_t* scene, real* x) {
  int any = 0;
  for (int i = 0; i < NX; ++i) any |= BEYOND(x[i], scene->largest);
  for (int j = 0; any && j < LANES; ++j)
    if (!is_lane_within_reach(scene, x, j))
      for (int i = 0; i < NX; ++i) LANE(x[i], j) = __builtin_nan("");
}

/* Advance the arms first … last-1; an arm is marked that meets a stop, and its states are invalid from there on.
 *
 * out:  states of every tick, the first included, (ticks + 1) * NX per arm; if last_only, NX per arm.
 * effort: receives effective commands of every tick, ticks * NU per arm; or null.
 * An arm that diverges is NaN from there on; other lanes are not affected.
 */
EXPORTED void rollout(const scene_t* scene, const arms_t* arms, long long first, long long last, double* out, int last_only,
                      double* effort) {
  const long long ticks = arms->ticks, row = last_only ? NX : (ticks + 1) * NX;
  const real length = arms->h;
  for (long long arm = first; arm < last; arm += LANES) {
    real x[NX], next[NX], r[NR], acted[NU], p[NP + 1];
    long long of_lane[LANES];
    begin_lanes(scene, arms, arm, last, of_lane, p);
    read_arms(x, NX, arms->x0, NX, of_lane);
    const int used = lanes_used(arm, last);
    for (long long k = 0; k < ticks && !is_halted(arms); ++k) {
      if (!last_only) write_arms(out + arm * row + k * NX, row, x, NX, used);
      if (k == 0 || arms->tau_tick) read_commands(arms, k, NR, of_lane, r);
      make_tick(scene, x, r, p, &length, used, arms->engine, next, acted);
      if (effort) write_arms(effort + (arm * ticks + k) * NU, ticks * NU, acted, NU, used);
      mark_stops(scene, arms, of_lane, x, next, 0);
      copy(x, next, NX);
      invalidate_diverged(scene, x);
    }
    write_arms(out + arm * row + (last_only ? 0 : ticks * NX), row, x, NX, used);
  }
}
