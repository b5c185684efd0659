/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks without events of LANES arms in a scene with events, for derivatives: the engine of one arm finds the modes.
 */

#pragma once
#include "lanes/predicted_ticks.h"
#include "modes/tick_record.h"

/* A tick of each lane.
 *
 * begin, end:   states at the ends of its motion
 * after:        state after the tick
 * p:            its modes
 * any_held:     whether anything is held in any lane
 * any_closed:   whether a contact is closed in any lane
 * as_predicted: whether the motions of all lanes are those predicted
 */
typedef struct {
  real *begin, *end, *after, *p;
  int any_held, any_closed, as_predicted;
} event_free_lanes_t;
#define EVENT_FREE_LANES (3 * NX + P_LENGTH + 1)

static inline event_free_lanes_t event_free_lanes_of(const scene_t* scene, real* numbers) {
  event_free_lanes_t tick = {numbers, numbers + NX, numbers + 2 * NX, numbers + 3 * NX, 0, 0, 0};
  return tick;
}

/* Whether closing the contacts at the end of a tick changed the state so little that its derivative can be that of a state
 * which satisfies them. */
static int closing_is_negligible(const scene_t* scene, const event_free_t* tick) {
  for (int i = 0; NC && i < 2 * NU; ++i)
    if (!(__builtin_fabs(tick->after[i] - tick->end[i]) < CLOSING_ROUNDING)) return 0;
  return 1;
}

/* Ask the engine for the probable modes of the ticks, for steps that are made before its own: nothing else is predicted. */
static void predict_modes(const scene_t* scene, const engine_t* engine, prediction_t* tick, event_free_lanes_t* lanes) {
  long long of_lane[LANES];
  lanes->any_held = 0;
  for (int j = 0; j < LANES; ++j) {
    of_lane[j] = j;
    engine->predict(engine->scene, tick + j);
    tick[j].needs_loads = tick[j].needs_mobility = tick[j].needs_closing = tick[j].has_near_loads = 0;
    lanes->any_held |= !all_moves(scene, tick[j].p);
  }
  read_arms(lanes->p, P_LENGTH, tick->p, PREDICTION, of_lane);
}

/* Whether a motion begins with the predicted numbers: it then is the predicted one. */
static int is_as_predicted(const scene_t* scene, const prediction_t* tick, const event_free_t* motion) {
  return same(motion->begin, tick->x, NX) && same(motion->p, tick->p, P_LENGTH) && same(motion->end, tick->after, NX);
}

/* Make the ticks of all lanes; `state_varied`: whether their beginning itself is varied. `event_free` is cleared for lanes
 * that have an event, or are too close to one; those lanes are not advanced. */
static void make_event_free(const scene_t* scene, const prediction_t* tick, const real* x, const real* u,
                            const engine_t* engine, int state_varied, int* event_free, event_free_lanes_t* lanes) {
  double numbers[LANES * EVENT_FREE];
  event_free_t motions[LANES];
  long long of_lane[LANES], any = 0;
  real limit[NC + 1], margins[2][2]; /* to boundaries between modes, at both ends */
  if (LANES > 1) memset(numbers, 0, sizeof numbers); /* of lanes that make no such tick */
  lanes->any_held = lanes->any_closed = 0;
  lanes->as_predicted = 1;
  for (int j = 0; j < LANES; ++j) {
    of_lane[j] = j;
    motions[j] = event_free_of(scene, numbers + j * EVENT_FREE);
    event_free[j] = event_free[j] && engine->event_free_tick(engine->scene, tick + j, motions + j)
                    && closing_is_negligible(scene, motions + j);
    if (!event_free[j]) continue;
    any = 1;
    lanes->any_held |= !all_moves(scene, motions[j].p);
    lanes->any_closed |= any_closed(scene, motions[j].p);
    lanes->as_predicted &= is_as_predicted(scene, tick + j, motions + j);
  }
  if (!any) return;
  read_arms(lanes->p, P_LENGTH, motions->p, EVENT_FREE, of_lane);
  read_arms(limit, NC, motions->stick_limit, EVENT_FREE, of_lane);
  read_arms(lanes->begin, NX, motions->begin, EVENT_FREE, of_lane);
  read_arms(lanes->end, NX, motions->end, EVENT_FREE, of_lane);
  read_arms(lanes->after, NX, motions->after, EVENT_FREE, of_lane);
  equation_t* margin = lanes->any_held ? scene->mode_margin : scene->mode_margin_in_motion;
  CALL(margin, (lanes->begin, u, lanes->p, limit), (margins[0]));
  CALL(margin, (lanes->end, u, lanes->p, limit), (margins[1]));
  for (int j = 0; j < LANES; ++j) {
    event_free[j] = event_free[j] && LANE(margins[0][state_varied], j) > 0.0 && LANE(margins[1][0], j) > 0.0;
    if (!event_free[j])
      for (int i = 0; i < NX; ++i) LANE(lanes->after[i], j) = LANE(x[i], j);
  }
}
