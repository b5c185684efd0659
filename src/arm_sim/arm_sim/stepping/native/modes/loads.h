/* SPDX-License-Identifier: Apache-2.0
 *
 * Loads and slopes at a state of LANES arms, in modes.
 */

#pragma once
#include "modes/prediction.h"

/* The numbers of loads_t: all results but the torques of stops. */
static void loads_at(const scene_t* scene, const real* x, const real* u, const real* p, real* loads) {
  CALL(scene->loads, (x, u, p), (loads, loads + NU, loads + NU + MC, loads + NU + 2 * MC, 0, loads + LOADS - NX));
}

static void slope_at(const scene_t* scene, const real* x, const real* u, const real* p, real* slope) {
  CALL(scene->rhs, (x, u, p), (slope));
}
