/* SPDX-License-Identifier: Apache-2.0
 *
 * Predicted ticks, for lanes and derivatives (see engine_t of prediction.h).
 */

#pragma once
#include "events/eventful_tick.h"

/* Guess the modes of a tick and the anchors of its contacts, and tell which evaluations at its beginning and end the tick will
 * ask for. */
EXPORTED void predict(const void* scene_of_tick, prediction_t* tick) {
  const scene_t* scene = (const scene_t*)scene_of_tick;
  LOCAL_TICK(segment, tick->u, tick->p, P_LENGTH);
  geometry_t geometry = geometry_of(scene, tick->geometry);
  guess_modes(scene, tick->x, &segment, &geometry);
  find_anchors(scene, &geometry, tick->anchor);
  copy(tick->p, segment.p.all, P_LENGTH);
  tick->needs_loads = anything_rests(scene, tick->x, &segment);
  tick->needs_closing = tick->needs_mobility = 0;
  for (int k = 0; k < NC; ++k) {
    tick->needs_closing |= segment.p.contact[k].closed != 0.0;
    tick->needs_mobility |= scene->friction[k] > 0.0 && is_sliding(segment.p.contact + k);
  }
}

/* Make a tick that is predicted: NONE, or why it cannot be computed. */
static enum trouble make_predicted_tick(const scene_t* scene, const prediction_t* tick, trace_t* trace, double* after) {
  report_t report = {0};
  /* Without the modes: they are found anew, and what is predicted in the same ones is used. */
  LOCAL_TICK(segment, tick->u, tick->p, NP);
  segment.predicted = tick;
  return tick_with_events(scene, tick->x, &segment, tick->length, &report, trace, after);
}

/* The predicted tick, whatever happens in it: 0 if it cannot be computed. */
EXPORTED int predicted_tick(const void* scene_of_tick, const prediction_t* tick, double* after) {
  const scene_t* scene = (const scene_t*)scene_of_tick;
  return make_predicted_tick(scene, tick, 0, after) == NONE;
}

/* The predicted tick if it has no event: 0 if it has one, or cannot be computed. */
EXPORTED int event_free_tick(const void* scene_of_tick, const prediction_t* tick, event_free_t* result) {
  const scene_t* scene = (const scene_t*)scene_of_tick;
  real numbers[RECORD];
  record_t record;
  trace_t trace = {.records = &record, .numbers = numbers, .capacity = 1};
  if (make_predicted_tick(scene, tick, &trace, result->after) != NONE) return 0;
  if (trace.count != 1 || !record.event_free || record.has_impact || trace.time_stepped) return 0;
  copy(result->p, record.p.all, P_LENGTH);
  copy(result->stick_limit, record.stick_limit, NC);
  copy(result->begin, record.motion_begin, NX);
  copy(result->end, record.motion_end, NX);
  return within_reach(scene, result->after);
}
