/* SPDX-License-Identifier: Apache-2.0
 *
 * Rollouts of one policy with several step sizes, LANES at a time.
 */
#include "lanes/lanes.h"
#include "lanes/one_tick.h"

/* Simulate arms over `nodes` ticks under u + size k + K (x' - x), within limits.
 *
 * x, u, k, K: the trajectory to be improved and its policy, rows of NX, NU, NU and NU * NX numbers per node.
 * low, high:  limits of the command, NU per node.
 * sizes:      step sizes, one per arm.
 * p:          parameters, for all arms.
 * out:        states; that of arm i at a node at out + i * out_arm + node * NX. The first is an input.
 * used:       receives commands, likewise, of NU numbers.
 * met:        set to 1 for an arm that meets a stop; its states are invalid from there on.
 * engine:     in a scene with events, that of one arm.
 */
EXPORTED void follow(const double* x, const double* u, const double* k, const double* K, const double* low, const double* high,
                     const double* sizes, const double* p, const double* h, long long nodes, long long arms, double* out,
                     long long out_arm, double* used, long long used_arm, signed char* met, const engine_t* engine) {
  const real length = h[0];
  for (long long arm = 0; arm < arms; arm += LANES) {
    real now[NX], next[NX], off[NX], r[NU], acted[NU], par[NP + 1], size[1];
    long long of_lane[LANES];
    choose_arms(arm, arms, of_lane);
    read_arms(now, NX, out, out_arm, of_lane);
    read_arms(par, NP, p, 0, of_lane);
    read_arms(size, 1, sizes, 1, of_lane);
    for (long long node = 0; node < nodes; ++node) {
      for (int i = 0; i < NX; ++i) off[i] = now[i] - x[node * NX + i];
      for (int i = 0; i < NU; ++i) {
        const long long row = node * NU + i;
        const real bottom = low[row], top = high[row];
        r[i] = size[0] * k[row] + u[row];
        for (int j = 0; j < NX; ++j) r[i] = r[i] + off[j] * K[row * NX + j];
        r[i] = fmin(fmax(r[i], bottom), top);
      }
      make_tick(now, r, par, &length, arms - arm < LANES ? (int)(arms - arm) : LANES, engine, next, acted);
      for (int j = 0; j < LANES && arm + j < arms; ++j) {
        for (int i = 0; i < NX; ++i) out[(arm + j) * out_arm + (node + 1) * NX + i] = LANE(next[i], j);
        for (int i = 0; i < NU; ++i) used[(arm + j) * used_arm + node * NU + i] = LANE(r[i], j);
      }
      for (int j = 0; j < LANES; ++j) met[of_lane[j]] |= meets_any_stop(now, next, h[0], j);
      for (int i = 0; i < NX; ++i) now[i] = next[i];
    }
  }
}
