/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of one arm that certainly have no event: one step, and a check that nothing may happen within it.
 */

#pragma once
#include "events/event_free.h"

/* What is known at the beginning of a tick that may have an event: where its contacts are, or loads in modes of sliding and
 * held joints. */
typedef struct {
  modes_t p;
  real* place;
  loads_t loads;
  int any_held;
} beginning_t;
#define BEGINNING (P_LENGTH + PLACES + LOADS)

static beginning_t beginning_of(const scene_t* scene, real* numbers) {
  beginning_t start = {modes_of(scene, numbers), numbers + P_LENGTH, loads_of(scene, numbers + P_LENGTH + PLACES), 0};
  return start;
}

/* A tick that certainly has no event, in which all joints slide or are held and no contact touches: 0 if it may have one. */
static int event_free_shortcut(const scene_t* scene, const real* x, const real* u, const real* p, double h, beginning_t* start,
                               real* after) {
  real place_after[PLACES + 1];
  LOCAL(step_of_lanes_t, step, step_of_lanes_of, STEP_OF_LANES);
  find_places(scene, x, start->place);
  const real event_free = event_free_at_begin(scene, x, u, p, start->place, start->p.all, &start->loads, &start->any_held);
  if (event_free == 0.0 || (start->any_held && NX > 2 * NU)) return 0; /* see event_free_step */
  int all_held = start->any_held;
  for (int i = 0; i < ND; ++i) all_held &= start->p.direction[i] == 0.0;
  if (!all_held
      && event_free_step(scene, x, u, &h, start->place, start->p.all, &start->loads, start->any_held, &step, place_after)
             == 0.0)
    return 0;
  copy(after, all_held ? x : step.next, NX);
  rest_held(scene, after);
  return 1;
}
