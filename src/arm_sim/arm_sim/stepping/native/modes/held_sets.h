/* SPDX-License-Identifier: Apache-2.0
 *
 * What holds together where statics does not determine the reactions, in the modes of a segment; release of a set that gives
 * way.
 */

#pragma once
#include "contact/indeterminate.h"
#include "modes/evaluations.h"

#define LIMIT_TOLERANCE 1e-9 /* relative distance from a limit, of a contact or a set, within which forces are at the limit */
#define AMOUNT_ROUNDING 1e-6 /* amount of a part's motion, as its set gives way, that is rounding */
#define SLIDING_FRACTION 1e-3 /* least fraction of a contact's motion that is sliding if it does not only open */

/* The balance of forces at x in the modes of a segment. */
static void find_statics(const scene_t* scene, const real* x, const segment_t* segment, statics_t* balance) {
  segment->memory->work += scene->statics_cost;
  CALL(scene->statics, (x, segment->u, segment->p.all), (balance->push, balance->reaction, balance->capacity, balance->drift));
}

/* What is held, with its reactions of the least norm and its limits. */
static void find_parts(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* loads,
                       const statics_t* balance, part_t* parts) {
  for (int i = 0; i < NU; ++i) {
    const int side = ND ? at_stop(scene, x, i) : 0;
    parts[i] = loose;
    parts[i].held = ND && segment->p.direction[i] == 0.0;
    parts[i].force[0] = balance->reaction[i];
    parts[i].lower = side < 0 ? -INFINITY : -balance->capacity[NU + i];
    parts[i].upper = side > 0 ? INFINITY : balance->capacity[i];
  }
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t* mode = segment->p.contact + k;
    part_t* part = parts + NU + k;
    *part = loose;
    part->held = mode->closed != 0.0;
    part->upper = INFINITY;
    part->fraction = stick_limit(scene, segment, k);
    part->sticks = part->held && mode->sticks != 0.0;
    for (int i = 0; i < 3; ++i) part->force[i] = loads->force[3 * k + i];
  }
}

/* Which parts hold together, and whether they do. */
static void find_sets_held(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* loads,
                           indeterminate_t* sets) {
  LOCAL(statics_t, balance, statics_of, STATICS);
  part_t parts[PARTS];
  find_statics(scene, x, segment, &balance);
  find_parts(scene, x, segment, loads, &balance, parts);
  find_indeterminate(scene, &balance, parts, segment->is_yielding, sets);
}

/* By how much a set exceeds its limits: not positive if it holds. One that has just reached them is taken to give way: the
 * tolerance is on the other side. */
static double set_excess(const segment_t* segment, const indeterminate_t* sets, int set_number) {
  return sets->excess[set_number] - (segment->is_yielding ? -LIMIT_TOLERANCE : EXCESS_ROUNDING);
}

/* Release a part in the motion in which its set gives way. */
static void release_part(const scene_t* scene, segment_t* segment, const indeterminate_t* sets, int i) {
  const double *motion = sets->motion + 2 * i, size = hypot(motion[0], motion[1]);
  if (i < NU) {
    segment->p.direction[i] = sign_of(motion[0]);
    segment->has_tried_reverse[i] = 0;
    return;
  }
  contact_mode_t* mode = segment->p.contact + i - NU;
  if (mode->sticks == 0.0 || size < SLIDING_FRACTION * sets->amount[i]) mode->closed = 0.0;
  if (mode->closed == 0.0) return;
  mode->sticks = 0.0;
  for (int j = 0; j < 2; ++j) mode->along[j] = motion[j] / size;
}

/* Release the parts of a set that gives way.
 *
 * In that motion contacts that slide rise by their friction coefficient, which they do not do in fact: joints are lifted off
 * their stops only where nothing else can be released. */
static void release_set(const scene_t* scene, const real* x, segment_t* segment, const indeterminate_t* sets, int set_number) {
  int any = 0;
  for (int at_stops = 0; at_stops < 2 && !any; ++at_stops)
    for (int i = 0; i < PARTS; ++i) {
      const int stopped = i < NU && at_stop(scene, x, i) != 0;
      if (sets->set[i] != set_number || sets->amount[i] <= AMOUNT_ROUNDING || stopped != at_stops) continue;
      release_part(scene, segment, sets, i);
      any = 1;
    }
}
