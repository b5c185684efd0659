/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks with events of LANES arms: functions of the motion without events are evaluated side by side, the logic of events
 * runs arm by arm.
 *
 * Before this file: arms.h, foreseen.h; SZ_ARG, SZ_RES, SZ_IW, SZ_W (as for flow.h), the generated `actuate`, `step`, with
 * MOVING `moving_step`, `rhs` and `loads`, and with contacts `contact_geometry`, `contact_inertia` and `contact_close`.
 */

#pragma once
#include "arms.h"
#include "foreseen.h"

#define MC (3 * NC)

/* Store some numbers of each arm; those of lane j go to to + j * stride. */
static void write_arms(double* to, long long stride, const real* from, int count) {
  for (int j = 0; j < LANES; ++j)
    for (int i = 0; i < count; ++i) to[j * stride + i] = LANE(from[i], j);
}

static void find_geometry(const real* x, real* found) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x};
  real* res[SZ_RES] = {found, found + MC, found + 2 * MC};
  contact_geometry(arg, res, iw, w, 0);
}

static void find_loads(const real* x, const real* u, const real* p, real* found) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p};
  real* res[SZ_RES] = {found, found + NU, found + NU + MC, found + NU + 2 * MC};
  loads(arg, res, iw, w, 0);
}

/* Step of all lanes in their modes, by the functions that the engine of one arm takes. */
static void step_of_lanes(const foreseen_t* tick, const real** arg, real** res) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
#ifdef MOVING
  real found[4 * NX], *moved[SZ_RES];
  int moves[LANES], moving = 0;
  for (int i = 0; i < 4; ++i) moved[i] = found + i * NX;
  for (int j = 0; j < LANES; ++j) moving += moves[j] = all_moves(tick[j].p + NP);
  if (moving < LANES) step(arg, res, iw, w, 0);
  if (moving) moving_step(arg, moving < LANES ? moved : res, iw, w, 0);
  if (!moving || moving == LANES) return;
  for (int k = 0; k < 4 * NX; ++k)
    for (int j = 0; j < LANES; ++j)
      if (moves[j]) LANE(res[k / NX][k % NX], j) = LANE(found[k], j);
#else
  (void)tick;
  step(arg, res, iw, w, 0);
#endif
}

/* Tick of length h of the first `used` lanes from x with inputs r and parameters `tunable`: the states after it, NaN for an
 * arm that cannot be advanced, and the effective commands. */
static void tick_of_lanes(const real* x, const real* r, const real* tunable, const real* h, int used, const engine_t* engine,
                          real* next, real* acted) {
  const long long stride = sizeof(foreseen_t) / sizeof(double);
  foreseen_t tick[LANES];
  long long of_lane[LANES], rests = 0, slides = 0, closes = 0;
  real p[NP + MODES], slope[NX], load[LOADS], place[PLACES], inertia[INERTIA], anchor[2 * NC], closed[2 * NU], w[SZ_W];
  real inside[3 * NX];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, r};
  real* res[SZ_RES] = {acted};
  actuate(arg, res, iw, w, 0);
  write_arms(tick->x, stride, x, NX);
  write_arms(tick->u, stride, acted, NU);
  write_arms(tick->p, stride, tunable, NP);
  find_geometry(x, place);
  write_arms(tick->geometry, stride, place, PLACES);
  for (int j = 0; j < LANES; ++j) {
    of_lane[j] = j;
    tick[j].length = LANE(*h, j);
    engine->foresee(tick + j);
    rests |= tick[j].rests;
    slides |= tick[j].slides;
    closes |= tick[j].closes;
  }
  read_arms(p, NP + MODES, tick->p, stride, of_lane);
  arg[1] = acted;
  arg[2] = p;
  arg[3] = h;
  res[0] = next;
  res[1] = inside;
  res[2] = inside + NX;
  res[3] = inside + 2 * NX;
  step_of_lanes(tick, arg, res);
  write_arms(tick->after, stride, next, NX);
  write_arms(tick->inside.slope[0], stride, inside, 3 * NX);
  find_geometry(next, place);
  write_arms(tick->geometry_after, stride, place, PLACES);
  if (rests) {
    res[0] = slope;
    rhs(arg, res, iw, w, 0);
    write_arms(tick->slope, stride, slope, NX);
    find_loads(x, acted, p, load);
    write_arms(tick->loads, stride, load, LOADS);
    find_loads(next, acted, p, load);
    write_arms(tick->loads_after, stride, load, LOADS);
  }
  if (slides) {
    res[0] = inertia;
    res[1] = inertia + MC * MC;
    res[2] = inertia + MC * MC + MC * NU;
    contact_inertia(arg, res, iw, w, 0);
    write_arms(tick->inertia, stride, inertia, INERTIA);
  }
  if (closes) {
    read_arms(anchor, 2 * NC, tick->anchor, stride, of_lane);
    arg[0] = next;
    arg[1] = p;
    arg[2] = anchor;
    res[0] = closed;
    contact_close(arg, res, iw, w, 0);
    write_arms(tick->closed, stride, closed, 2 * NU);
  }
  for (int j = 0; j < used; ++j) {
    double after[NX];
    const int good = tick[j].x[0] == tick[j].x[0] && engine->tick_as_foreseen(tick + j, after);
    for (int i = 0; i < NX; ++i) LANE(next[i], j) = good ? after[i] : __builtin_nan("");
  }
}
