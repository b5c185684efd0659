/* SPDX-License-Identifier: Apache-2.0
 *
 * Motion over a smooth segment, to the end of its modes, and which of them have ended there.
 */

#pragma once
#include "guards/guard_search.h"

#define STEP_LIMIT (scene->adaptive ? scene->substep_limit : 1)

/* Whether an accepted attempt that an event cuts to `length` is accurate, with its error `size` then: an attempt that passes
 * over what happens close to the event may not notice it. If not, a shorter one is to be tried from the same beginning.
 */
static int is_accurate_cut(const scene_t* scene, substeps_t* at, double h, double length, double size) {
  if (size <= 1.0 || length < SHORTEST * h) return 1;
  const double factor = SAFETY * pow(size, -1.0 / scene->order);
  at->done -= at->trial;
  at->step = length * (factor > LEAST_FACTOR ? factor : LEAST_FACTOR);
  return 0;
}

/* Note a step of a traced tick. */
static void record_step(const segment_t* segment, double length) {
  trace_t* trace = segment->trace;
  if (!segment->record) return;
  if (trace->step_count < trace->step_capacity) trace->steps[trace->step_count] = length;
  ++trace->step_count;
  ++segment->record->steps;
}

/* Motion to the end of the modes, at most over `reach`: its length, -1 if it cannot be computed. Every step is watched: of
 * fixed length the only one, under error control each that is accepted; there an attempt may also be cut at an event,
 * and tried again if it is not accurate up to that. `after` receives the state at the end, `event_free` whether no event ended
 * it.
 */
static double advance_segment(const scene_t* scene, const real* x, segment_t* segment, double reach, real* after,
                              int* event_free) {
  LOCAL(piece_t, own, piece_of, PIECE);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL(guard_values_t, guards, guard_values_of, GUARD_VALUES);
  double ground[NC + 1];
  search_t search = {scene, own, segment, ground};
  piece_t* piece = &search.piece;
  control_t* control = segment->control;
  find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) ground[k] = fmin(geometry.place[3 * k], 0.0);
  copy(piece->begin, x, NX);
  begin_piece(scene, segment, piece);
  *event_free = 0;
  substeps_t at = first_substep(reach, scene->adaptive ? control->step : reach);
  for (long long k = 0; k < STEP_LIMIT; ++k) {
    real error[2];
    int last = 1;
    error[0] = error[1] = 0.0;
    segment->memory->work += scene->step_cost;
    const double h = scene->adaptive ? next_length(&at, reach) : reach;
    const int reached = make_step(scene, segment, h, piece, error);
    if (scene->adaptive) {
      ++control->attempts;
      const enum outcome outcome = control_step(scene, &at, reach, error[0] / control->tolerance, reached);
      if (outcome == STEP_TOO_SMALL) break;
      if (outcome == REJECTED) continue;
      last = outcome == ENDED;
    }
    const double violation = find_violation(scene, &search, h, reached, &guards);
    *event_free = violation == 0.0;
    const double length = *event_free ? h : end_at_event(scene, &search, violation, &guards, error);
    if (length < 0.0) return -1.0;
    if (scene->adaptive) {
      if (!*event_free && !is_accurate_cut(scene, &at, reach, length, error[0] / control->tolerance)) continue;
      control->error += error[1];
      control->step = at.step;
    }
    piece->from += length;
    record_step(segment, length);
    copy(piece->begin, piece->end, NX);
    if (last || !*event_free) {
      copy(after, piece->end, NX);
      return last && *event_free ? reach : piece->from;
    }
    begin_piece(scene, segment, piece);
  }
  /* The direction of a contact is undefined as it comes to rest: error control follows it as far as possible. */
  *event_free = 0;
  copy(after, piece->begin, NX);
  return piece->from > 0.0 ? piece->from : -1.0;
}

/* Next mode of contacts whose mode has just ended: lift off, or slip; and whether a set that holds together has. */
static void find_ended_modes(const scene_t* scene, const real* x, segment_t* segment, int event_free) {
  segment->is_yielding = 0;
  for (int k = 0; k < NC; ++k) segment->contact[k].next_state = STICKS;
  if (event_free || !(NC || scene->constrained)) return;
  LOCAL(loads_t, loads, loads_of, LOADS);
  LOCAL(indeterminate_t, sets, indeterminate_of, INDETERMINATE);
  clear(sets.set, PARTS);
  find_loads(scene, x, segment, &loads);
  if (scene->indeterminate) {
    segment->is_yielding = 1; /* an evaluation at the limit */
    find_sets_held(scene, x, segment, &loads, &sets);
    int any = 0;
    for (int i = 0; i < PARTS; ++i) any |= sets.set[i] != 0.0 && set_excess(segment, &sets, (int)sets.set[i]) > 0.0;
    segment->is_yielding = any;
  }
  for (int k = 0; k < NC; ++k) {
    const real* r = loads.force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    contact_t* contact = segment->contact + k;
    if (mode->closed == 0.0 || sets.set[NU + k] != 0.0) continue;
    const double size = hypot(r[1], r[2]);
    if (r[0] <= 0.0) contact->next_state = APART;
    else if (mode->sticks != 0.0 && size >= stick_limit(scene, segment, k) * r[0] && scene->static_friction[k] > 0.0) {
      contact->next_state = SLIDES;
      for (int i = 0; i < 2; ++i) contact->slip_direction[i] = -r[1 + i] / size;
    }
  }
}
