/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of LANES arms that certainly have no event: their modes, a step in these, and bounds of what may happen within it.
 *
 * The engine makes the same steps in the same modes, so the motion does not depend on which of both made a tick.
 */

#pragma once
#include "modes/prediction.h"
#include "guards/smoothness.h"

/* A step of all lanes, with its continuous output and the loads at its stage at the end. */
typedef struct {
  real *all, *next, *inside, *near_loads;
} step_of_lanes_t;
#define STEP_OF_LANES (4 * NX + NEAR_LOADS)

static inline step_of_lanes_t step_of_lanes_of(const scene_t* scene, real* numbers) {
  step_of_lanes_t step = {numbers, numbers, numbers + NX, numbers + 4 * NX};
  return step;
}

/* Make a step in modes p by the functions that the engine of one arm takes; `loads` are those at its beginning, or null. */
static void make_steps(const scene_t* scene, const real* x, const real* u, const real* p, const real* h, const loads_t* loads,
                       step_of_lanes_t* step) {
  int moving_lanes = 0, is_moving[LANES];
  for (int j = 0; scene->has_moving_equations && j < LANES; ++j) {
    double own[P_LENGTH + 1];
    for (int i = NP; i < P_LENGTH; ++i) own[i] = LANE(p[i], j);
    is_moving[j] = all_moves(scene, own);
    moving_lanes += is_moving[j];
  }
  if (moving_lanes == LANES) {
    CALL(scene->moving_step, (x, u, p, h), (step->next, step->inside, step->inside + NX, step->inside + 2 * NX));
    return;
  }
  if (loads) copy(step->inside, loads->slope, NX);
  else slope_at(scene, x, u, p, step->inside);
  CALL(scene->step, (x, u, p, h, step->inside),
       (step->next, step->inside + NX, step->inside + 2 * NX, step->near_loads, step->near_loads + NU));
  if (!moving_lanes) return;
  real moved[4 * NX];
  CALL(scene->moving_step, (x, u, p, h), (moved, moved + NX, moved + 2 * NX, moved + 3 * NX));
  for (int k = 0; k < 4 * NX; ++k)
    for (int j = 0; j < LANES; ++j)
      if (is_moving[j]) LANE(step->all[k], j) = LANE(moved[k], j);
}

#define CERTAINTY 1e-9 /* speeds that are not rounding, relative to the fastest joint; gaps, relative to their lengths */
#define FAR_FRACTION (0.9 - LIMIT_MARGIN) /* of a limit: loads up to it are not near the limit at either end of a tick */

/* Lanes in which every contact is apart and every joint slides or is at rest, beyond rounding; `modes` receives their modes if
 * what is at rest stays there. */
static real find_certain_modes(const scene_t* scene, const real* x, const geometry_t* at, const modes_t* modes) {
  const real zero = 0.0;
  real event_free = 1.0, fastest = 1.0;
  for (int i = 0; i < NU; ++i) fastest = fmax(fastest, fabs(x[NU + i]));
  for (int i = 0; i < ND; ++i) {
    modes->direction[i] = 1.0;
    if (!(scene->static_level[i] > 0.0)) continue;
    modes->direction[i] = (zero < x[NU + i]) - (x[NU + i] < zero);
    event_free = event_free && (CERTAINTY * fastest < fabs(x[NU + i]) || x[NU + i] == zero);
  }
  clear((real*)modes->contact, CONTACT_MODE * NC);
  for (int k = 0; k < NC; ++k) event_free = event_free && CERTAINTY * at->size[k] < at->place[3 * k];
  return event_free;
}

/* Give joints that are held the speed 0, as the engine does, where it is -0; other speeds do not change. */
static void rest_held(const scene_t* scene, real* x) {
  for (int i = 0; i < ND; ++i)
    if (scene->static_level[i] > 0.0) x[NU + i] += 0.0;
}

/* Lanes in which what is at rest stays there under loads far below the limits of friction. */
static real stays_held(const scene_t* scene, const real* load, const modes_t* modes) {
  const real zero = 0.0;
  real held = 1.0;
  for (int i = 0; i < ND; ++i)
    if (scene->static_level[i] > 0.0)
      held = held && (modes->direction[i] != zero || fabs(load[i]) < FAR_FRACTION * scene->static_level[i]);
  return held;
}

/* Of lanes whose modes are certain, those in which no joint turns or meets a stop and no contact comes near within a step. */
static real event_free_within_step(const scene_t* scene, const real* x, const step_of_lanes_t* step, const geometry_t* begin,
                                   const geometry_t* end, const modes_t* modes, real h) {
  const real zero = 0.0;
  real event_free = 1.0, low, high;
  for (int i = 0; i < NX; ++i) event_free = event_free && fabs(step->next[i]) <= scene->largest;
  for (int i = 0; i < NU; ++i) {
    bound_inside(scene, x, step->next, step->inside, h, i, &low, &high);
    event_free = event_free && scene->stop_place[0][i] < low && high < scene->stop_place[1][i];
    if (!(ND && scene->static_level[i] > 0.0)) continue;
    bound_inside(scene, x, step->next, step->inside, h, NU + i, &low, &high);
    const real ahead = 0.5 * (modes->direction[i] * (low + high) + low - high); /* low, or -high for a joint that moves back */
    event_free = event_free && (modes->direction[i] == zero || zero < ahead);
  }
  for (int k = 0; k < NC; ++k) {
    bound_cubic(begin->place[3 * k], begin->speed[3 * k], end->place[3 * k], end->speed[3 * k], h, &low, &high);
    event_free = event_free && LIMIT_MARGIN * (high - low) + CERTAINTY * begin->size[k] < low;
  }
  return event_free;
}

/* Lanes without events at the beginning of a tick. `p` receives tunable numbers and modes, `any_held` whether a joint is
 * held in some lane, and `loads` the loads if one is. */
static real event_free_at_begin(const scene_t* scene, const real* x, const real* u, const real* tunable, const real* place,
                                real* p, const loads_t* loads, int* any_held) {
  const modes_t modes = modes_of(scene, p);
  const geometry_t geometry = geometry_of(scene, place);
  int any = 0;
  copy(modes.all, tunable, NP);
  real event_free = find_certain_modes(scene, x, &geometry, &modes);
  for (int j = 0; j < LANES; ++j) any |= LANE(event_free, j) != 0.0;
  *any_held = 0;
  for (int i = 0; any && i < ND; ++i)
    for (int j = 0; j < LANES; ++j) *any_held |= LANE(modes.direction[i], j) == 0.0;
  if (*any_held) loads_at(scene, x, u, p, loads);
  if (*any_held && NX == 2 * NU) event_free = event_free && stays_held(scene, loads->load, &modes);
  return event_free;
}

/* Make the step, and find the lanes without events in it; `after` receives where the contacts are after it. Of ticks
 * with internal states, which may break a joint loose within the step, none that holds a joint is among them. */
static real event_free_step(const scene_t* scene, const real* x, const real* u, const real* h, const real* place,
                            const real* p, const loads_t* loads, int any_held, step_of_lanes_t* step, real* after) {
  const modes_t modes = modes_of(scene, (real*)p);
  const geometry_t begin = geometry_of(scene, place), end = geometry_of(scene, after);
  make_steps(scene, x, u, p, h, any_held ? loads : 0, step);
  find_places(scene, step->next, after);
  real event_free = event_free_within_step(scene, x, step, &begin, &end, &modes, *h);
  if (!any_held) return event_free;
  if (NX > 2 * NU) return 0.0 * event_free;
  event_free = event_free && varies_evenly(scene, x, step->next, step->inside, *h);
  if (scene->has_near_loads) return event_free && stays_held(scene, step->near_loads, &modes);
  LOCAL(loads_t, end_loads, loads_of, LOADS);
  loads_at(scene, step->next, u, p, &end_loads);
  return event_free && stays_held(scene, end_loads.load, &modes);
}
