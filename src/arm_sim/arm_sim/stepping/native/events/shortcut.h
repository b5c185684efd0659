/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of one arm that clearly have no event: one step, and a check that nothing may happen within it.
 */

#pragma once
#include "events/event_free.h"
#include "guards/switch_guards.h"
#include "motion/stops.h"

/* Whether no joint may meet a stop in a motion to `next`, and no drive or cord switch: whether each moves by less than half of its
 * distance; and beforehand, whether none is so close to a stop that no step away from stops need be tried. */
static int stays_free(const scene_t* scene, const real* x, const real* u, const real* next, double h) {
  int meets = 0;
  for (int i = 0; i < NU; ++i)
    meets |= meets_stop(scene, x[i], x[NU + i], next ? next[i] : x[i], next ? next[NU + i] : 0.0, h, 0.0, i);
  if (!NK || !next || meets) return !meets;
  LOCAL(segment_t, segment, segment_of, SEGMENT);
  real value[2][NK + 1], size[NK + 1];
  segment.u = u;
  find_switches(scene, x, &segment, value[0], size);
  find_switches(scene, next, &segment, value[1], size);
  for (int k = 0; k < NK; ++k) {
    const double a = value[0][k], b = value[1][k];
    meets |= !(fabs(b - a) < 0.5 * fmin(fabs(a), fabs(b)) || (a == b && fabs(a) > SWITCH_ROUNDING * size[k]));
  }
  return !meets;
}

/* Whether every joint is held. */
static int holds_all(const scene_t* scene, const real* modes) {
  int all = ND > 0;
  for (int i = 0; i < ND; ++i) all &= modes[i] == 0.0;
  return all;
}

/* What is known at the beginning of a tick that may have an event: where its contacts are, or loads in modes of sliding and held
 * joints. */
typedef struct {
  real *p, *place;
  loads_t load;
  int holds;
} beginning_t;
#define BEGINNING (P_LENGTH + PLACES + LOADS)

static beginning_t beginning_of(const scene_t* scene, real* numbers) {
  beginning_t start = {numbers, numbers + P_LENGTH, loads_of(scene, numbers + P_LENGTH + PLACES), 0};
  return start;
}

/* A tick that clearly has no event, in which all joints slide or are held and no contact touches: 0 if it may have one. */
static int event_free_shortcut(const scene_t* scene, const real* x, const real* u, const real* p, double h, beginning_t* start,
                               real* after) {
  real place_after[PLACES + 1];
  LOCAL(step_of_lanes_t, step, step_of_lanes_of, STEP_OF_LANES);
  find_places(scene, x, start->place);
  const real begins = clear_at_begin(scene, x, u, p, start->place, start->p, start->load.load, &start->holds);
  if (begins == 0.0 || (start->holds && NX > 2 * NU)) return 0;
  const int still = start->holds && holds_all(scene, start->p + NP);
  if (!still && clear_step(scene, x, u, &h, start->place, start->p, start->load.load, start->holds, &step, place_after) == 0.0)
    return 0;
  copy(after, still ? x : step.next, NX);
  rest_held(scene, after);
  return 1;
}
