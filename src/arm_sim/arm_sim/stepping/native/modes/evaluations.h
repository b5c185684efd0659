/* SPDX-License-Identifier: Apache-2.0
 *
 * Evaluations of the generated functions in a segment: what is predicted or remembered is not computed again.
 */

#pragma once
#include "modes/segment_state.h"

/* Whether answers are known for the modes of a segment. */
static int is_predicted(const scene_t* scene, const segment_t* segment) {
  return segment->predicted && same(segment->p.all, segment->predicted->p, P_LENGTH);
}

/* Remember where the contacts are at x, in place of the older of two states. */
static void keep_geometry(const scene_t* scene, const real* x, memory_t* memory, const real* geometry) {
  const long long place = memory->states++ % STATES;
  copy(memory->x[place], x, 2 * NU);
  copy(memory->geometry[place].all, geometry, PLACES);
}

/* Where the contacts are at x; nothing is found without contacts. */
static void find_geometry(const scene_t* scene, const real* x, const segment_t* segment, geometry_t* geometry) {
  const prediction_t* prediction = segment->predicted;
  if (!NC) return;
  const double* answer = 0;
  if (prediction && same(x, prediction->x, 2 * NU)) answer = prediction->geometry;
  else if (prediction && same(x, prediction->after, 2 * NU)) answer = prediction->geometry_after;
  memory_t* memory = segment->memory;
  for (int i = 0; !answer && i < STATES && i < memory->states; ++i)
    if (same(x, memory->x[i], 2 * NU)) answer = memory->geometry[i].all;
  if (answer) {
    copy(geometry->all, answer, PLACES);
    return;
  }
  find_places(scene, x, geometry->all);
  keep_geometry(scene, x, memory, geometry->all);
}

/* Whether the loads at x are known; `known` receives where they are. */
static int knows_loads(const scene_t* scene, const real* x, const segment_t* segment, loads_t* known) {
  const prediction_t* prediction = segment->predicted;
  const memory_t* memory = segment->memory;
  const int predicted = is_predicted(scene, segment) && prediction->needs_loads && same(x, prediction->x, NX);
  *known = predicted ? loads_of(scene, prediction->loads) : memory->loads;
  return predicted
         || (memory->has_loads && same(x, memory->loads_x, NX) && same(segment->p.all + NP, memory->loads_modes, MODES));
}

static void keep_loads(const scene_t* scene, const real* x, const real* modes, memory_t* memory, const loads_t* loads) {
  memory->has_loads = 1;
  copy(memory->loads.all, loads->all, LOADS);
  copy(memory->loads_x, x, NX);
  copy(memory->loads_modes, modes, MODES);
}

/* Loads and accelerations at x in the modes of a segment. */
static void find_loads(const scene_t* scene, const real* x, const segment_t* segment, loads_t* loads) {
  memory_t* memory = segment->memory;
  loads_t known;
  if (knows_loads(scene, x, segment, &known)) {
    copy(loads->all, known.all, LOADS);
    return;
  }
  memory->work += scene->loads_cost;
  loads_at(scene, x, segment->u, segment->p.all, loads);
  keep_loads(scene, x, segment->p.all + NP, memory, loads);
}

/* Mobility of the contacts at x in the modes of a segment. Its work is counted also where it is predicted. */
static void find_mobility(const scene_t* scene, const real* x, const segment_t* segment, mobility_t* mobility) {
  const prediction_t* prediction = segment->predicted;
  segment->memory->work += scene->mobility_cost;
  if (!NC) return;
  if (is_predicted(scene, segment) && prediction->needs_mobility && same(x, prediction->x, NX)) {
    copy(mobility->all, prediction->mobility, MOBILITY);
    return;
  }
  mobility_at(scene, x, segment->u, segment->p.all, mobility);
}

/* x' at x in the modes of a segment. */
static void find_slope(const scene_t* scene, const real* x, const segment_t* segment, real* slope) {
  loads_t known;
  const real* answer = knows_loads(scene, x, segment, &known) ? known.slope : 0;
  /* In motion the prediction's slope is that of `moving_step`: the same in other expressions, which round differently. */
  if (!scene->has_moving_equations && is_predicted(scene, segment) && same(x, segment->predicted->x, NX))
    answer = segment->predicted->inside;
  if (answer) {
    copy(slope, answer, NX);
    return;
  }
  segment->memory->work += scene->slope_cost;
  slope_at(scene, x, segment->u, segment->p.all, slope);
}

/* Switching functions of drives and cords, positive where a comparison holds, and the magnitude of their terms. */
static void find_switches(const scene_t* scene, const real* x, const segment_t* segment, real* value, real* size) {
  if (!NK) return;
  CALL(scene->switches, (x, segment->u, segment->p.all), (value, size));
}
