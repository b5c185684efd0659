/* SPDX-License-Identifier: Apache-2.0
 *
 * Detection of contact with the joints' stops, both rigid and compliant.
 */

#pragma once
#include "scene.h"

/* Whether a joint may meet a stop in a motion from q, v to q_end, v_end. The cubic with these ends goes no farther than half
 * of `way`; the rest is for its error. `margin` is added.
 */
static inline int meets_stop(const scene_t* scene, double q, double v, double q_end, double v_end, double length,
                             double margin, int joint) {
  const double way = 2.0 * __builtin_fabs(q_end - q) + length * (__builtin_fabs(v) + __builtin_fabs(v_end)) + margin;
  return (q - way <= scene->stop_place[0][joint]) | (q + way >= scene->stop_place[1][joint]);
}
