/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards of drives and cords: comparisons on which their equations depend.
 */

#pragma once
#include "guards/guard.h"

#define SWITCH_ROUNDING 1e-13 /* of a comparison, relative to what is compared */

/* The sign of a comparison in its mode. */
static double side_of(const segment_t* segment, int k) { return segment->p.switches[k] != 0.0 ? 1.0 : -1.0; }

static void evaluate_switch_guards(const scene_t* scene, const guarded_t* at, guard_values_t* guards) {
  real *value = at->segment->memory->switch_values, *size = value + NK;
  find_switches(scene, at->x, at->segment, value, size);
  for (int k = 0; k < NK; ++k)
    if (size[k] > 0.0) /* else nothing is compared, as the engagement of teeth within their backlash */
      guards->switched[k] = -side_of(at->segment, k) * value[k] - SWITCH_ROUNDING * size[k];
}

/* Whether one may switch and back: whether a wave passes, or it comes close, as the middle shows. The parabola through three
 * values leaves their range by an eighth of it at most; the rest is for what is no parabola. */
static int switch_may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  const piece_t* piece = &search->piece;
  const segment_t* segment = search->segment;
  real x[NX], value[NK + 1], size[NK + 1], middle[NK + 1];
  if (!NK) return 0;
  if (phase_of(scene, piece->begin, piece->end) > 1.0) return 1;
  state_inside(scene, piece, 0.5, x);
  find_switches(scene, x, segment, middle, size);
  find_switches(scene, piece->begin, segment, value, size);
  for (int k = 0; k < NK; ++k) {
    const double side = side_of(segment, k), begin = side * value[k], inside = side * middle[k], last = -end->switched[k];
    const double least = fmin(fmin(begin, inside), last), most = fmax(fmax(begin, inside), last);
    if (least <= 0.5 * (most - least)) return 1;
  }
  return 0;
}
