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
 * out:        states; that of arm i at a node at out + i * out_arm + node * NX. The first is an input.
 * used:       receives commands, likewise, of NU numbers.
 * An arm is marked that meets a stop; its states are invalid from there on.
 */
EXPORTED void ilqr_follow(const scene_t* scene, const arms_t* arms, long long count, const double* x, const double* u,
                          const double* k, const double* K, const double* low, const double* high, const double* sizes,
                          double* out, long long out_arm, double* used, long long used_arm) {
  const real length = arms->h;
  for (long long arm = 0; arm < count; arm += LANES) {
    real now[NX], next[NX], off[NX], r[NU], acted[NU], p[NP + 1], size[1];
    long long of_lane[LANES];
    begin_lanes(scene, arms, arm, count, of_lane, p);
    read_arms(now, NX, out, out_arm, of_lane);
    read_arms(size, 1, sizes, 1, of_lane);
    for (long long node = 0; node < arms->ticks; ++node) {
      for (int i = 0; i < NX; ++i) off[i] = now[i] - x[node * NX + i];
      for (int i = 0; i < NU; ++i) {
        const long long row = node * NU + i;
        const real bottom = low[row], top = high[row];
        r[i] = size[0] * k[row] + u[row];
        for (int j = 0; j < NX; ++j) r[i] = r[i] + off[j] * K[row * NX + j];
        r[i] = fmin(fmax(r[i], bottom), top);
      }
      make_tick(scene, now, r, p, &length, lanes_used(arm, count), arms->engine, next, acted);
      write_arms(out + arm * out_arm + (node + 1) * NX, out_arm, next, NX, lanes_used(arm, count));
      write_arms(used + arm * used_arm + node * NU, used_arm, r, NU, lanes_used(arm, count));
      mark_stops(scene, arms, of_lane, now, next, 0);
      copy(now, next, NX);
    }
  }
}
