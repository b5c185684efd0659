/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards of sets that hold together where statics does not determine their reactions, in place of those of their parts.
 */

#pragma once
#include "modes/modes.h"
#include "guards/guard.h"

/* In place of the guards of a set's parts: by how much its reactions of the least norm exceed a limit. */
static void evaluate_set_guards(const scene_t* scene, const guarded_t* at, guard_values_t* guards) {
  const segment_t* segment = at->segment;
  if (!scene->indeterminate || all_moves(scene, segment->p.all)) return;
  if (!anything_beyond(scene, at->x, segment, &at->loads)) return;
  LOCAL(indeterminate_t, sets, indeterminate_of, INDETERMINATE);
  find_sets_held(scene, at->x, segment, &at->loads, &sets);
  for (int i = 0; i < ND; ++i)
    if (sets.set[i] != 0.0) guards->joint[i] = -INFINITY;
  for (int k = 0; k < NC; ++k) {
    if (sets.set[NU + k] == 0.0) continue;
    *normal_guard(guards, k) = -INFINITY;
    if (segment->p.contact[k].sticks != 0.0) *tangential_guard(guards, k) = -INFINITY;
  }
  for (int i = 0; i < PARTS; ++i)
    if (sets.set[i] != 0.0) *guards->sets = fmax(*guards->sets, set_excess(segment, &sets, (int)sets.set[i]));
}

/* A set that is near its limit at the end of a piece may have given way inside it. */
static int set_may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  (void)search;
  return scene->indeterminate && *end->sets > -LIMIT_MARGIN;
}
