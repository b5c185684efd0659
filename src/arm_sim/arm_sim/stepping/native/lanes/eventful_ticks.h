/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks with events of LANES arms: functions of the motion without events are evaluated side by side, the logic of events
 * runs arm by arm.
 */

#pragma once
#include "events/event_free.h"
#include "lanes/predicted_ticks.h"

#define FEW (LANES / 4) /* lanes for which predicting takes longer than it saves */

/* Steps from the beginnings of ticks, and where the contacts are after them. */
static void write_steps_of_lanes(const step_of_lanes_t* made, const real* place, prediction_t* tick) {
  write_steps(made->next, made->inside, place, tick);
  if (!NEAR_LOADS) return;
  write_arms(tick->near, sizeof(prediction_t) / sizeof(double), made->near, NEARS);
  for (int j = 0; j < LANES; ++j) tick[j].nears = STEADY;
}

/* Steps of lanes whose modes are clear, which the engine of one arm may then take from `tick`: 1 in `done` for those that
 * surely have no event, so that it need not be asked. Returns the number of other lanes, of the first `used`; where they
 * are most, no step is made. With contacts, the engine's modes contain more, and it makes a step of its own. */
static int predict_event_free(const real* x, const real* u, const real* tunable, const real* h, const real* place, int used,
                              prediction_t* tick, real* next, real* done) {
  real p[NP + MODES + 1], after[PLACES + 1], load[LOADS + 1];
  step_of_lanes_t made;
  int others = 0, left = 0, holds;
  const real event_free = begins_event_free(x, u, tunable, place, p, load, &holds);
  for (int j = 0; j < used; ++j) others += LANE(event_free, j) == 0.0;
  if (2 * others > used) return others;
  *done = event_free && stays_event_free(x, u, h, place, p, load, holds, &made, after);
  for (int i = 0; i < NX; ++i) next[i] = made.next[i];
  rest_held(next);
  for (int j = 0; j < used; ++j) left += LANE(*done, j) == 0.0;
  if (!left) return 0;
  write_steps_of_lanes(&made, after, tick);
  for (int j = 0; j < used; ++j)
    for (int i = NP; i < NP + MODES && LANE(event_free, j) != 0.0; ++i) tick[j].p[i] = LANE(p[i], j);
  return others;
}

/* What lanes will ask for in the modes that the engine guesses. */
static void predict_in_guessed_modes(const real* x, const real* u, const real* h, const engine_t* engine, prediction_t* tick) {
  const long long stride = sizeof(prediction_t) / sizeof(double);
  long long of_lane[LANES], rests = 0, slides = 0, closes = 0;
  real p[NP + MODES], load[LOADS], place[PLACES], inertia[INERTIA], anchor[2 * NC], closed[2 * NU], w[SZ_W];
  step_of_lanes_t made;
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p};
  real* res[SZ_RES];
  for (int j = 0; j < LANES; ++j) {
    of_lane[j] = j;
    engine->predict(tick + j);
    rests |= tick[j].rests;
    slides |= tick[j].slides;
    closes |= tick[j].closes;
  }
  read_arms(p, NP + MODES, tick->p, stride, of_lane);
  if (rests) {
    loads_at(x, u, p, load);
    write_arms(tick->loads, stride, load, LOADS);
  }
  make_steps(x, u, p, h, rests ? load : 0, &made);
  find_places(made.next, place);
  write_steps_of_lanes(&made, place, tick);
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
  prediction_t tick[LANES];
  real place[PLACES], done = 0.0, w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, r};
  real* res[SZ_RES] = {acted};
  int others = used, left = 0;
  actuate(arg, res, iw, w, 0);
  begin_ticks(x, acted, tunable, h, tick, place);
  if (PLAIN) others = predict_event_free(x, acted, tunable, h, place, used, tick, next, &done);
  for (int j = 0; j < used; ++j) left += LANE(done, j) == 0.0;
  if (left && others > FEW) predict_in_guessed_modes(x, acted, h, engine, tick);
  for (int j = 0; j < used; ++j) {
    double after[NX];
    if (LANE(done, j) != 0.0) continue;
    const int good = tick[j].x[0] == tick[j].x[0] && engine->predicted_tick(tick + j, after);
    for (int i = 0; i < NX; ++i) LANE(next[i], j) = good ? after[i] : __builtin_nan("");
  }
}
