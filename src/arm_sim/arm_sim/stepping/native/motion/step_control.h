/* SPDX-License-Identifier: Apache-2.0
 *
 * Lengths of the sub-steps of a tick under error control.
 *
 * Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 1993, section II.4.
 */

#pragma once
#include "scene.h"

#define SAFETY 0.9       /* of the predicted length */
#define LEAST_FACTOR 0.2 /* of a length from one sub-step to the next */
#define MOST_FACTOR 6.0  /* of a length from one sub-step to the next, also where the error is rounding */
#define TINY_ERROR 1e-10 /* relative to the tolerance: the next length is then MOST_FACTOR times this one */
#define SHORTEST 1e-12   /* sub-step, relative to the tick */

/* The sub-steps of a tick: times are relative to its beginning. */
typedef struct {
  double done;  /* time of the tick that is behind */
  double step;  /* length to try next, later of the next tick */
  double trial; /* length that is tried now */
  int last;     /* whether that ends the tick */
} substeps_t;

enum outcome { REJECTED, ACCEPTED, ENDED, STEP_TOO_SMALL };

/* Of a tick of length h; `step`: what the last tick left, 0: not known yet. */
static inline substeps_t first_substep(double h, double step) {
  substeps_t at = {0.0, step > 0.0 ? step : h, 0.0, 0};
  return at;
}

/* Length of the next attempt in a tick of length h. */
static inline double next_length(substeps_t* at, double h) {
  const double left = h - at->done;
  at->last = at->step >= left * (1.0 - SHORTEST);
  return at->trial = at->last ? left : at->step;
}

/* What to do after an attempt. size: its error, relative to the tolerance; reached: whether its end is finite. */
static inline enum outcome control_step(const scene_t* scene, substeps_t* at, double h, double size, int reached) {
  double factor = size < TINY_ERROR ? MOST_FACTOR : SAFETY * pow(size, -1.0 / scene->order); /* NaN must shrink it */
  factor = !(factor > LEAST_FACTOR) || !reached ? LEAST_FACTOR : factor > MOST_FACTOR ? MOST_FACTOR : factor;
  if (!(size <= 1.0) || !reached) {
    at->step = at->trial * factor;
    return at->step < SHORTEST * h ? STEP_TOO_SMALL : REJECTED;
  }
  at->done += at->trial;
  /* A last sub-step that was cut short says little of how long the next may be. */
  if (!at->last || at->trial * factor > at->step) at->step = at->trial * factor;
  return at->last ? ENDED : ACCEPTED;
}
