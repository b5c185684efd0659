/* SPDX-License-Identifier: Apache-2.0
 *
 * Gradients passed backwards through the parts of a tick: its motion under the effective command, and that command.
 */

#pragma once
#include "scene.h"

/* The effective command at a state under inputs r. */
static void find_command(const real* x, const real* r, real* u) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, r};
  real* res[SZ_RES] = {u};
  acting(arg, res, iw, w, 0);
}

/* Gradients by state, command and parameters of a motion of length h, from that by its end. */
static void through_motion(const real* x, const real* u, const real* p, const real* h, const real* weight, real* by_x,
                           real* by_u, real* by_p) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p, h, weight};
  real* res[SZ_RES] = {by_x, by_u, by_p};
  adjoint(arg, res, iw, w, 0);
}

/* Gradients by state and inputs, from that by the effective command. */
static void through_command(const real* x, const real* r, const real* weight, real* by_x, real* by_r) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, r, weight};
  real* res[SZ_RES] = {by_x, by_r};
  limit_adjoint(arg, res, iw, w, 0);
}
