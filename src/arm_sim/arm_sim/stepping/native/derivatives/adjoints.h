/* SPDX-License-Identifier: Apache-2.0
 *
 * Gradients passed backwards through the parts of a tick: its motion under the effective command, and that command.
 */

#pragma once
#include "scene.h"

/* Gradients by state, command and parameters of a motion of length h, from that by its end. */
static void through_motion(const scene_t* scene, const real* x, const real* u, const real* p, const real* h,
                           const real* weight, real* by_x, real* by_u, real* by_p) {
  CALL(scene->adjoint, (x, u, p, h, weight), (by_x, by_u, by_p));
}

/* Gradients by state and inputs, from that by the effective command. */
static void through_command(const scene_t* scene, const real* x, const real* r, const real* weight, real* by_x, real* by_r) {
  CALL(scene->limit_adjoint, (x, r, weight), (by_x, by_r));
}
