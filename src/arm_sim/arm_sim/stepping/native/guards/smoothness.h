/* SPDX-License-Identifier: Apache-2.0
 *
 * How much forces may vary inside a step that look alike at both of its ends: of LANES arms.
 */

#pragma once
#include "scene.h"

#define SMALL_PHASE 0.1      /* in [rad] */
#define LARGEST_BEND 0.1             /* of an acceleration inside a step, relative to its sizes at both ends */
#define SPEED_ROUNDING_OF_STEP 1e-12   /* rounding of a change of speed, relative to the speed */

/* Phase of all waves in the joints' positions that passes in a step, in [rad]. */
static inline real phase_of(const scene_t* scene, const real* x, const real* next) {
  real phase = 0.0;
  for (int i = 0; i < NU; ++i) phase = phase + scene->wave_number[i] * fabs(next[i] - x[i]);
  return phase;
}

/* Whether forces change so evenly in a step of length h that they have no peak inside which is not close to their values at
 * its ends: hardly a wave passes, and accelerations bend little. The parabola through the accelerations a and b at the ends
 * with the step's mean acceleration differs from (a + b) / 2 in the middle by 3/2 mean - 3/4 (a + b); bounded is twice that.
 * `inside`: slopes at the beginning and the end, NX each, see prediction_t. */
static inline real varies_evenly(const scene_t* scene, const real* x, const real* next, const real* inside, real h) {
  real even = phase_of(scene, x, next) <= SMALL_PHASE;
  for (int i = NU; i < 2 * NU; ++i) {
    const real a = h * inside[i], b = h * inside[NX + i], change = next[i] - x[i];
    even = even
           && fabs(3.0 * change - 1.5 * (a + b))
                  <= LARGEST_BEND * (fabs(a) + fabs(b)) + SPEED_ROUNDING_OF_STEP * (1.0 + fabs(x[i]));
  }
  return even;
}
