/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks with events of LANES arms: functions of the motion without events are evaluated side by side, the logic of events
 * runs arm by arm.
 *
 * Before this file: ticks.h; SZ_ARG, SZ_RES, SZ_IW, SZ_W (as for flow.h), the generated `actuate`, `step`, with NEAR_LOADS if
 * it returns loads, with MOVING `moving_step`, `rhs` and `loads`, and with contacts `contact_geometry`, `contact_inertia` and
 * `contact_close`. With CALM, where modes are those of sliding joints and of contacts alone, also STATIC, LOWEST and HIGHEST
 * (levels of static friction and stops, by joint).
 */

#pragma once
#include "stops.h"
#include "ticks.h"

#define FEW (LANES / 4) /* lanes for which foreseeing takes longer than it saves */

static void find_loads(const real* x, const real* u, const real* p, real* found) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p};
  real* res[SZ_RES] = {found, found + NU, found + NU + MC, found + NU + 2 * MC, 0, found + LOADS - NX};
  loads(arg, res, iw, w, 0);
}

static void find_slope(const real* x, const real* u, const real* p, real* slope) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p};
  real* res[SZ_RES] = {slope};
  rhs(arg, res, iw, w, 0);
}

/* A step of all lanes, with its continuous output and the loads at its stage at the end. */
typedef struct {
  real next[NX], inside[3 * NX], near[NEARS];
} step_of_lanes_t;

/* Make a step in modes p by the functions that the engine of one arm takes; `load` are the loads at its beginning, or null. */
static void make_steps(const real* x, const real* u, const real* p, const real* h, const real* load, step_of_lanes_t* made) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p, h, made->inside};
  real* res[SZ_RES] = {made->next, made->inside + NX, made->inside + 2 * NX, made->near, made->near + NU};
  int moving = 0;
#ifdef MOVING
  int moves[LANES];
  for (int j = 0; j < LANES; ++j) {
    double modes[MODES + 1];
    for (int i = 0; i < MODES; ++i) modes[i] = LANE(p[NP + i], j);
    moving += moves[j] = all_moves(modes);
  }
#endif
  if (moving < LANES) {
    if (load) memcpy(made->inside, load + LOADS - NX, NX * sizeof *load);
    else find_slope(x, u, p, made->inside);
    step(arg, res, iw, w, 0);
  }
#ifdef MOVING
  if (!moving) return;
  real found[4 * NX];
  for (int i = 0; i < 4; ++i) res[i] = found + i * NX;
  moving_step(arg, res, iw, w, 0);
  for (int k = 0; k < 4 * NX; ++k)
    for (int j = 0; j < LANES; ++j)
      if (moves[j]) LANE((k < NX ? made->next + k : made->inside + k - NX)[0], j) = LANE(found[k], j);
#endif
}

/* Steps from the beginnings of ticks, and where the contacts are after them. */
static void write_made(const step_of_lanes_t* made, const real* place, foreseen_t* tick) {
  write_steps(made->next, made->inside, place, tick);
#ifdef NEAR_LOADS
  write_arms(tick->near, sizeof(foreseen_t) / sizeof(double), made->near, NEARS);
  for (int j = 0; j < LANES; ++j) tick[j].nears = STEADY;
#endif
}

#ifdef CALM
#define MOVES 1e-9 /* speeds that are not rounding, relative to the fastest joint; gaps, relative to their lengths */
#define FAR_BELOW (0.9 - NEAR) /* loads that are not near a limit at either end of a tick */
static const double static_of[NU] = STATIC;

/* Lanes in which every contact is apart and every joint slides or is at rest, clearly so; `p` receives their modes if what is
 * at rest stays there. */
static real find_modes_of_lanes(const real* x, const real* place, real* p) {
  const real none = 0.0;
  real clear = 1.0, fastest = 1.0;
  for (int i = 0; i < NU; ++i) fastest = fmax(fastest, fabs(x[NU + i]));
  for (int i = 0; i < ND; ++i) {
    const real speed = fabs(x[NU + i]);
    p[i] = 1.0;
    if (!(static_of[i] > 0.0)) continue;
    p[i] = (none < x[NU + i]) - (x[NU + i] < none);
    clear = clear && (MOVES * fastest < speed || speed == none);
  }
  for (int i = 0; i < 5 * NC; ++i) p[ND + i] = 0.0;
  for (int k = 0; k < NC; ++k) clear = clear && MOVES * place[2 * MC + k] < place[3 * k];
  return clear;
}

/* Whether a joint is held in some lane. */
static int holds_any(const real* p) {
  int any = 0;
  for (int i = 0; i < ND; ++i)
    for (int j = 0; j < LANES; ++j) any |= LANE(p[i], j) == 0.0;
  return any;
}

/* Lanes in which what is at rest stays there under loads far below the limits of friction. */
static real find_held(const real* load, const real* p) {
  const real none = 0.0;
  real held = 1.0;
  for (int i = 0; i < ND; ++i)
    if (static_of[i] > 0.0) held = held && (p[NP + i] != none || fabs(load[i]) < FAR_BELOW * static_of[i]);
  return held;
}

/* Of lanes whose modes are clear, those in which no joint turns or meets a stop and no contact comes near within a step. */
static real find_calm(const real* x, const real* next, const real* inside, const real* place, const real* after, const real* p,
                      real h) {
  const real none = 0.0;
  real calm = 1.0, low, high;
  for (int i = 0; i < NX; ++i) calm = calm && fabs(next[i]) <= LARGEST;
  for (int i = 0; i < NU; ++i) {
    bound_inside(x, next, inside, h, i, &low, &high);
    calm = calm && stop_place[0][i] < low && high < stop_place[1][i];
    if (!(ND && static_of[i] > 0.0)) continue;
    bound_inside(x, next, inside, h, NU + i, &low, &high);
    const real ahead = 0.5 * (p[i] * (low + high) + low - high); /* low, or -high for a joint that moves back */
    calm = calm && (p[i] == none || none < ahead);
  }
  for (int k = 0; k < NC; ++k) {
    bound_cubic(place[3 * k], place[MC + 3 * k], after[3 * k], after[MC + 3 * k], h, &low, &high);
    calm = calm && NEAR * (high - low) + MOVES * place[2 * MC + k] < low;
  }
  return calm;
}

/* Steps of lanes whose modes are clear, which the engine of one arm may then take from `tick`: 1 in `done` for those that
 * surely have no event, so that it need not be asked. Returns the number of other lanes, of the first `used`; where they
 * are most, no step is made. With contacts, the engine's modes contain more, and it makes a step of its own. */
static int foresee_clear(const real* x, const real* u, const real* tunable, const real* h, const real* place, int used,
                         foreseen_t* tick, real* next, real* done) {
  real p[NP + MODES + 1], after[PLACES + 1], load[LOADS + 1];
  step_of_lanes_t made;
  int others = 0, left = 0;
  for (int i = 0; i < NP; ++i) p[i] = tunable[i];
  real clear = find_modes_of_lanes(x, place, p + NP);
  const int holds = holds_any(p + NP);
  if (holds) find_loads(x, u, p, load);
  if (holds && NX == 2 * NU) clear = clear && find_held(load, p);
  for (int j = 0; j < used; ++j) others += LANE(clear, j) == 0.0;
  if (2 * others > used) return others;
  make_steps(x, u, p, h, holds ? load : 0, &made);
  for (int i = 0; i < NX; ++i) next[i] = made.next[i];
  find_geometry(next, after);
  *done = clear && find_calm(x, next, made.inside, place, after, p + NP, *h);
#ifdef NEAR_LOADS
  if (holds) *done = NX == 2 * NU ? *done && find_held(made.near, p) : 0.0 * *done;
#else
  if (holds && NX == 2 * NU) find_loads(next, u, p, load);
  if (holds) *done = NX == 2 * NU ? *done && find_held(load, p) : 0.0 * *done;
#endif
  for (int j = 0; j < used; ++j) left += LANE(*done, j) == 0.0;
  if (!left) return 0;
  write_made(&made, after, tick);
  for (int j = 0; j < used; ++j)
    for (int i = NP; i < NP + MODES && LANE(clear, j) != 0.0; ++i) tick[j].p[i] = LANE(p[i], j);
  return others;
}
#endif

/* What lanes will ask for in the modes that the engine guesses. */
static void foresee_guess(const real* x, const real* u, const real* h, const engine_t* engine, foreseen_t* tick) {
  const long long stride = sizeof(foreseen_t) / sizeof(double);
  long long of_lane[LANES], rests = 0, slides = 0, closes = 0;
  real p[NP + MODES], load[LOADS], place[PLACES], inertia[INERTIA], anchor[2 * NC], closed[2 * NU], w[SZ_W];
  step_of_lanes_t made;
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p};
  real* res[SZ_RES];
  for (int j = 0; j < LANES; ++j) {
    of_lane[j] = j;
    engine->foresee(tick + j);
    rests |= tick[j].rests;
    slides |= tick[j].slides;
    closes |= tick[j].closes;
  }
  read_arms(p, NP + MODES, tick->p, stride, of_lane);
  if (rests) {
    find_loads(x, u, p, load);
    write_arms(tick->loads, stride, load, LOADS);
  }
  make_steps(x, u, p, h, rests ? load : 0, &made);
  find_geometry(made.next, place);
  write_made(&made, place, tick);
  if (slides) {
    res[0] = inertia;
    res[1] = inertia + MC * MC;
    res[2] = inertia + MC * MC + MC * NU;
    contact_inertia(arg, res, iw, w, 0);
    write_arms(tick->inertia, stride, inertia, INERTIA);
  }
  if (closes) {
    read_arms(anchor, 2 * NC, tick->anchor, stride, of_lane);
    arg[0] = made.next;
    arg[1] = p;
    arg[2] = anchor;
    res[0] = closed;
    contact_close(arg, res, iw, w, 0);
    write_arms(tick->closed, stride, closed, 2 * NU);
  }
}

/* Tick of length h of the first `used` lanes from x with inputs r and parameters `tunable`: the states after it, NaN for an
 * arm that cannot be advanced, and the effective commands. */
static void tick_of_lanes(const real* x, const real* r, const real* tunable, const real* h, int used, const engine_t* engine,
                          real* next, real* acted) {
  foreseen_t tick[LANES];
  real place[PLACES], done = 0.0, w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, r};
  real* res[SZ_RES] = {acted};
  int others = used, left = 0;
  actuate(arg, res, iw, w, 0);
  begin_ticks(x, acted, tunable, h, tick, place);
#ifdef CALM
  others = foresee_clear(x, acted, tunable, h, place, used, tick, next, &done);
#endif
  for (int j = 0; j < used; ++j) left += LANE(done, j) == 0.0;
  if (left && others > FEW) foresee_guess(x, acted, h, engine, tick);
  for (int j = 0; j < used; ++j) {
    double after[NX];
    if (LANE(done, j) != 0.0) continue;
    const int good = tick[j].x[0] == tick[j].x[0] && engine->tick_as_foreseen(tick + j, after);
    for (int i = 0; i < NX; ++i) LANE(next[i], j) = good ? after[i] : __builtin_nan("");
  }
}
