/* SPDX-License-Identifier: Apache-2.0
 *
 * Joints that stop: by friction as their velocity reverses, and at their rigid stops.
 */

#pragma once
#include "modes/segment_state.h"

#define STOP_SPEED 1e-6 /* speed tolerated of a joint that is found to stop, relative to the fastest joint */

/* Whether a joint that friction may hold has stopped, or moves against its sliding direction. */
static int reverses(const scene_t* scene, const real* x, const segment_t* segment, int joint) {
  return may_stick(scene, joint) && x[NU + joint] * segment->p.direction[joint] <= 0.0;
}

/* Set joints that have just reached zero speed at rest: 0 if one was still fast, since the motion was not continuous. */
static int stop_joints(const scene_t* scene, real* x, const segment_t* segment) {
  const double fastest = max_abs(x + NU, NU);
  for (int i = 0; i < ND; ++i)
    if (reverses(scene, x, segment, i)) {
      if (fabs(x[NU + i]) > STOP_SPEED * (1.0 + fastest)) return 0;
      x[NU + i] = 0.0;
    }
  return 1;
}

/* Move joints that are beyond a rigid stop by rounding to the stop. */
static void stop_at_limits(const scene_t* scene, real* x) {
  for (int i = 0; scene->rigid && i < NU; ++i) x[i] = fmin(fmax(x[i], scene->rigid_stop[0][i]), scene->rigid_stop[1][i]);
}
