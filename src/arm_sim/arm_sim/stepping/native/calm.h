/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks without events of LANES arms in a scene with events, for derivatives: the engine of one arm finds the modes.
 *
 * Required definitions: foreseen.h, arms.h; SZ_ARG, SZ_RES, SZ_IW, SZ_W (work space of the generated functions), and the
 * generated `clear` (x, u, p, limit) -> two margins, positive if the state is on no boundary between two modes, the second
 * also if a motion that begins there differs little from those nearby; `clear_in_motion`: the same where nothing is held.
 */

#pragma once
#include "arms.h"
#include "foreseen.h"

#include <string.h>

#define CLOSED_ALREADY 1e-12 /* change of the state by closing contacts that were closed to rounding */

/* A tick of each lane. */
typedef struct {
  real begin[NX], after[NX], p[NP + MODES + 1], end[NX]; /* the motion's beginning, state after the tick, modes, its end */
  int held, closed;                                      /* whether anything is held, or a contact closed, in any lane */
} calm_lanes_t;

/* Whether closing the contacts at the end of a tick changed the state so little that its derivative can be that of a state
 * which satisfies them. */
static int is_closed(const calm_t* tick) {
  double off = 0.0;
  for (int i = 0; i < 2 * NU; ++i) {
    const double change = __builtin_fabs(tick->after[i] - tick->end[i]);
    if (change > off) off = change;
  }
  return !NC || off < CLOSED_ALREADY;
}

/* Whether a contact is closed, in parameters with modes. */
static int touches(const double* p) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= p[NP + ND + NQ + NK + 5 * k] != 0.0;
  return any;
}

/* Margins to boundaries between modes of a state in the tick. */
static void find_margins(const real* x, const real* u, const calm_lanes_t* tick, const real* limit, real* margins) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, tick->p, limit};
  real* res[SZ_RES] = {margins};
  if (tick->held) clear(arg, res, iw, w, 0);
  else clear_in_motion(arg, res, iw, w, 0);
}

/* Make a tick of length h of all lanes from x under the command u that acts; `starts`: whether its beginning itself is
 * varied. `calm` is cleared for lanes that have an event, or are too close to one; those lanes are not advanced. */
static void make_calm(const real* x, const real* u, const real* tunable, double h, const engine_t* engine, int starts,
                      int* calm, calm_lanes_t* found) {
  calm_t tick[LANES];
  const long long stride = sizeof(calm_t) / sizeof(double);
  long long of_lane[LANES];
  real limit[NC + 1], margins[2][2];
  memset(tick, 0, sizeof tick);
  found->held = found->closed = 0;
  for (int j = 0; j < LANES; ++j) {
    of_lane[j] = j;
    for (int i = 0; i < NX; ++i) tick[j].x[i] = LANE(x[i], j);
    for (int i = 0; i < NU; ++i) tick[j].u[i] = LANE(u[i], j);
    for (int i = 0; i < NP; ++i) tick[j].tunable[i] = LANE(tunable[i], j);
    tick[j].length = h;
    calm[j] = calm[j] && engine->calm_tick(tick + j) && is_closed(tick + j);
    if (!calm[j]) continue;
    found->held |= !all_moves(tick[j].p + NP);
    found->closed |= touches(tick[j].p);
  }
  read_arms(found->p, NP + MODES, tick->p, stride, of_lane);
  read_arms(limit, NC, tick->limit, stride, of_lane);
  read_arms(found->begin, NX, tick->begin, stride, of_lane);
  read_arms(found->end, NX, tick->end, stride, of_lane);
  read_arms(found->after, NX, tick->after, stride, of_lane);
  find_margins(found->begin, u, found, limit, margins[0]);
  find_margins(found->end, u, found, limit, margins[1]);
  for (int j = 0; j < LANES; ++j) {
    calm[j] = calm[j] && LANE(margins[0][starts], j) > 0.0 && LANE(margins[1][0], j) > 0.0;
    if (!calm[j])
      for (int i = 0; i < NX; ++i) LANE(found->after[i], j) = LANE(x[i], j);
  }
}
