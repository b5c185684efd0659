/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of LANES arms for the engine of one arm: what is given, and steps that it need not make again.
 */

#pragma once
#include "lanes/lanes.h"

/* Beginnings of ticks of length h from x under commands that act, of which nothing is predicted: modes and ends are NaN, see
 * prediction_t. `place` receives where the contacts are. */
static inline void begin_ticks(const scene_t* scene, const real* x, const real* u, const real* tunable, const real* h,
                               prediction_t* tick, real* place) {
  const long long stride = PREDICTION;
  find_places(scene, x, place);
  write_arms(tick->x, stride, x, NX, LANES);
  write_arms(tick->u, stride, u, NU, LANES);
  write_arms(tick->p, stride, tunable, NP, LANES);
  write_arms(tick->geometry, stride, place, PLACES, LANES);
  for (int j = 0; j < LANES; ++j) {
    tick[j].length = LANE(*h, j);
    tick[j].after[0] = __builtin_nan("");
    tick[j].needs_loads = tick[j].needs_mobility = tick[j].needs_closing = tick[j].has_near_loads = 0;
    for (int i = NP; i < P_LENGTH; ++i) tick[j].p[i] = __builtin_nan("");
  }
}

/* Steps from the beginnings of ticks, with their continuous output, loads near their ends, if these are known, and where the
 * contacts are after them. */
static inline void write_steps(const scene_t* scene, const real* next, const real* inside, const real* near, const real* place,
                               prediction_t* tick) {
  const long long stride = PREDICTION;
  write_arms(tick->after, stride, next, NX, LANES);
  write_arms(tick->inside, stride, inside, 3 * NX, LANES);
  write_arms(tick->geometry_after, stride, place, PLACES, LANES);
  if (!near) return;
  write_arms(tick->near_loads, stride, near, NEAR_LOADS, LANES);
  for (int j = 0; j < LANES; ++j) tick[j].has_near_loads = NEAR_LOADS_SERVE;
}
