/* SPDX-License-Identifier: Apache-2.0
 *
 * Gradients of functions of the states of a rollout, LANES arms at a time. Only states at ticks are kept; the motion within
 * a tick is recomputed in the backward pass.
 */
#include "lanes/one_tick.h"

/* The arms first … last-1; an arm is marked that meets a stop or diverges, and its gradients are invalid.
 *
 * g:      gradients by the states of every tick, the first included, NX per tick.
 * motion: work space, ticks * NX * LANES numbers.
 * by_x, by_tau, by_p: receive gradients, NX, ticks * NU and NP per arm.
 */
EXPORTED void rollout_gradient(const scene_t* scene, const arms_t* arms, long long first, long long last, const double* g,
                               double* motion, double* by_x, double* by_tau, double* by_p) {
  const long long ticks = arms->ticks;
  const real length = arms->h;
  for (long long arm = first; arm < last; arm += LANES) {
    real x[NX], next[NX], r[NU], u[NU], p[NP + 1], sum[NP + 1], weight[NX], back[NX], more[NX], of_u[NU], of_r[NU],
        of_p[NP + 1];
    long long of_lane[LANES];
    begin_lanes(scene, arms, arm, last, of_lane, p);
    read_arms(x, NX, arms->x0, NX, of_lane);
    for (long long k = 0; k < ticks && !is_halted(arms); ++k) {
      memcpy(motion + k * NX * LANES, x, (size_t)NX * sizeof *x);
      read_commands(arms, k, NU, of_lane, r);
      make_tick(scene, x, r, p, &length, LANES, 0, next, u);
      mark_stops(scene, arms, of_lane, x, next, 0);
      copy(x, next, NX);
    }
    for (int j = 0; j < LANES; ++j) arms->unfinished[of_lane[j]] |= !is_lane_within_reach(scene, x, j);
    clear(sum, NP);
    clear(weight, NX);
    for (long long k = ticks; k >= 0 && !is_halted(arms); --k) {
      for (int j = 0; j < LANES; ++j)
        for (int i = 0; i < NX; ++i) LANE(weight[i], j) += g[(of_lane[j] * (ticks + 1) + k) * NX + i];
      if (k == 0) break;
      memcpy(x, motion + (k - 1) * NX * LANES, (size_t)NX * sizeof *x);
      read_commands(arms, k - 1, NU, of_lane, r);
      CALL(scene->acting, (x, r), (u));
      CALL(scene->adjoint, (x, u, p, &length, weight), (back, of_u, of_p));
      CALL(scene->limit_adjoint, (x, r, of_u), (more, of_r));
      for (int i = 0; i < NX; ++i) weight[i] = back[i] + more[i];
      for (int i = 0; i < NP; ++i) sum[i] += of_p[i];
      write_arms(by_tau + (arm * ticks + k - 1) * NU, ticks * NU, of_r, NU, lanes_used(arm, last));
    }
    write_arms(by_x + arm * NX, NX, weight, NX, lanes_used(arm, last));
    write_arms(by_p + arm * NP, NP, sum, NP, lanes_used(arm, last));
  }
}
