/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick of LANES arms, with or without events.
 */

#pragma once
#include "lanes/lanes.h"

#if EVENTS
#include "lanes/eventful_ticks.h"
#define make_tick tick_of_lanes
#else
#include "lanes/prediction.h"

/* Tick of length h from x with inputs r and parameters `tunable`: the states after it, and the effective commands. */
static void make_tick(const real* x, const real* r, const real* tunable, const real* h, int used, const engine_t* engine,
                      real* next, real* acted) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, r, tunable, h};
  real* res[SZ_RES] = {next, acted};
  (void)used;
  (void)engine;
  TICK(arg, res, iw, w, 0);
}
#endif
