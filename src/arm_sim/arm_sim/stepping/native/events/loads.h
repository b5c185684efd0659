/* SPDX-License-Identifier: Apache-2.0
 *
 * Loads and slopes at a state of LANES arms, in modes.
 */

#pragma once
#include "lanes/prediction.h"

/* The numbers of loads_t: all results but the torques of stops. */
static void loads_at(const real* x, const real* u, const real* p, real* found) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p};
  real* res[SZ_RES] = {found, found + NU, found + NU + MC, found + NU + 2 * MC, 0, found + LOADS - NX};
  loads(arg, res, iw, w, 0);
}

static void slope_at(const real* x, const real* u, const real* p, real* slope) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p};
  real* res[SZ_RES] = {slope};
  rhs(arg, res, iw, w, 0);
}
