/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks with events of LANES arms: functions of the motion without events are evaluated side by side, the logic of events
 * runs arm by arm.
 */

#pragma once
#include "events/event_free.h"
#include "lanes/predicted_ticks.h"

#define FEW_LANES (LANES / 4) /* lanes for which predicting takes longer than it saves */

/* Lanes of the first `used` for which a mask is zero. */
static inline int count_left(const real* mask, int used) {
  int left = 0;
  for (int j = 0; j < used; ++j) left += LANE(*mask, j) == 0.0;
  return left;
}

/* Make the steps of lanes whose modes p are certain, which the engine of one arm may then take from `tick`: a mask of those
 * that surely have no event, so that it need not be asked, with their states in `next`. With contacts, the engine's modes
 * contain more, and it makes a step of its own. */
static real step_certain(const scene_t* scene, const real* x, const real* u, const real* h, const real* place, const real* p,
                         const loads_t* loads, int any_held, const real* certain, int used, prediction_t* tick, real* next) {
  real after[PLACES + 1];
  LOCAL(step_of_lanes_t, step, step_of_lanes_of, STEP_OF_LANES);
  const real done = *certain && event_free_step(scene, x, u, h, place, p, loads, any_held, &step, after);
  copy(next, step.next, NX);
  rest_held(scene, next);
  if (!count_left(&done, used)) return done;
  write_steps(scene, step.next, step.inside, scene->has_near_loads ? step.near_loads : 0, after, tick);
  for (int j = 0; j < used; ++j)
    for (int i = NP; i < P_LENGTH && LANE(*certain, j) != 0.0; ++i) tick[j].p[i] = LANE(p[i], j);
  return done;
}

/* What lanes will ask for in the modes that the engine guesses. */
static void predict_in_guessed_modes(const scene_t* scene, const real* x, const real* u, const real* h, const engine_t* engine,
                                     prediction_t* tick) {
  const long long stride = PREDICTION;
  long long of_lane[LANES], any_loads = 0, any_mobility = 0, any_closing = 0;
  real p[P_LENGTH + 1], place[PLACES + 1], anchor[2 * NC + 1], closed[2 * NU];
  LOCAL(loads_t, loads, loads_of, LOADS);
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  LOCAL(step_of_lanes_t, step, step_of_lanes_of, STEP_OF_LANES);
  for (int j = 0; j < LANES; ++j) {
    of_lane[j] = j;
    engine->predict(engine->scene, tick + j);
    any_loads |= tick[j].needs_loads;
    any_mobility |= tick[j].needs_mobility;
    any_closing |= tick[j].needs_closing;
  }
  read_arms(p, P_LENGTH, tick->p, stride, of_lane);
  if (any_loads) {
    loads_at(scene, x, u, p, &loads);
    write_arms(tick->loads, stride, loads.all, LOADS, LANES);
  }
  make_steps(scene, x, u, p, h, any_loads ? &loads : 0, &step);
  find_places(scene, step.next, place);
  write_steps(scene, step.next, step.inside, scene->has_near_loads ? step.near_loads : 0, place, tick);
  if (any_mobility) {
    mobility_at(scene, x, u, p, &mobility);
    write_arms(tick->mobility, stride, mobility.all, MOBILITY, LANES);
  }
  if (any_closing) {
    read_arms(anchor, 2 * NC, tick->anchor, stride, of_lane);
    CALL(scene->contact_close, (step.next, p, anchor), (closed));
    write_arms(tick->closed, stride, closed, 2 * NU, LANES);
  }
}

/* Tick of length h of the first `used` lanes from x with inputs r and parameters `tunable`: the states after it, NaN for an
 * arm that cannot be advanced, and the effective commands. */
static void tick_of_lanes(const scene_t* scene, const real* x, const real* r, const real* tunable, const real* h, int used,
                          const engine_t* engine, real* next, real* acted) {
  LOCAL_PREDICTIONS(tick);
  LOCAL(loads_t, loads, loads_of, LOADS);
  real place[PLACES + 1], p[P_LENGTH + 1], done = 0.0;
  int uncertain = used, any_held;
  CALL(scene->actuate, (x, r), (acted));
  begin_ticks(scene, x, acted, tunable, h, tick, place);
  if (scene->joints_and_contacts_only) {
    const real certain = event_free_at_begin(scene, x, acted, tunable, place, p, &loads, &any_held);
    uncertain = count_left(&certain, used);
    if (2 * uncertain <= used) /* else few lanes would use the steps */
      done = step_certain(scene, x, acted, h, place, p, &loads, any_held, &certain, used, tick, next);
  }
  if (count_left(&done, used) && uncertain > FEW_LANES) predict_in_guessed_modes(scene, x, acted, h, engine, tick);
  for (int j = 0; j < used; ++j) {
    double after[NX];
    if (LANE(done, j) != 0.0) continue;
    const int good = tick[j].x[0] == tick[j].x[0] && engine->predicted_tick(engine->scene, tick + j, after);
    for (int i = 0; i < NX; ++i) LANE(next[i], j) = good ? after[i] : __builtin_nan("");
  }
}
