/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick of LANES arms, with or without events.
 */

#pragma once
#include "lanes/lanes.h"

#if EVENTS
#include "lanes/eventful_ticks.h"
#endif

/* Tick of length h from x with inputs r and parameters `tunable`: the states after it, and the effective commands. */
static void make_tick(const scene_t* scene, const real* x, const real* r, const real* tunable, const real* h, int used,
                      const engine_t* engine, real* next, real* acted) {
#if EVENTS
  if (scene->eventful) {
    tick_of_lanes(scene, x, r, tunable, h, used, engine, next, acted);
    return;
  }
#endif
  (void)used;
  (void)engine;
  CALL(scene->tick, (x, r, tunable, h), (next, acted));
}
