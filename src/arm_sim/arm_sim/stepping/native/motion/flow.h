/* SPDX-License-Identifier: Apache-2.0
 *
 * Smooth motion: one step of fixed length, or sub-steps under error control. */

#pragma once
#include "motion/step_control.h"

/* State of the error control between sub-steps. Python: SubstepControl. */
typedef struct {
  double tolerance; /* largest scaled error of a sub-step */
  double step;      /* next trial length; 0: unknown */
  double error;     /* sum of the estimated errors of q */
  long long attempts;
} control_t;

/* Whether every number of a state is finite and not too large. */
static int within_reach(const scene_t* scene, const real* x) {
  int reached = 1;
  for (int i = 0; i < NX; ++i) reached &= !BEYOND(x[i], scene->largest);
  return reached;
}

/* Whether equations without modes describe a motion of length h from x to `next`, or, where that is null, its beginning. */
typedef int validity_t(const scene_t* scene, const real* x, const real* u, const real* next, double h);

/* Motion over h from x under u by sub-steps under error control; `is_valid` may be null. */
static int adaptive_flow(const scene_t* scene, equation_t* attempt, validity_t* is_valid, const real* x, const real* u,
                         const real* p, double h, control_t* control, real* after) {
  control_t updated = *control;
  substeps_t at = first_substep(h, control->step);
  real next[NX], error, error_q, trial;
  copy(after, x, NX);
  for (long long k = 0; k < scene->substep_limit; ++k) {
    trial = next_length(&at, h);
    if (is_valid && !is_valid(scene, after, u, 0, trial)) return 0;
    CALL(attempt, (after, u, p, &trial), (next, &error, &error_q));
    ++updated.attempts;
    const enum outcome outcome = control_step(scene, &at, h, error / control->tolerance, within_reach(scene, next));
    if (outcome == STEP_TOO_SMALL) break;
    if (outcome == REJECTED) continue;
    if (is_valid && !is_valid(scene, after, u, next, trial)) return 0;
    copy(after, next, NX);
    updated.error += error_q;
    if (outcome != ENDED) continue;
    updated.step = at.step;
    *control = updated;
    return 1;
  }
  if (!is_valid) *control = updated; /* else the tick is made by other means */
  return 0;
}

/* Motion over h from x under u by one step of fixed length, or under error control; `is_valid` may be null. */
static int flow(const scene_t* scene, equation_t* step, equation_t* attempt, validity_t* is_valid, const real* x,
                const real* u, const real* p, double h, control_t* control, real* after) {
  const real length = h;
  if (scene->adaptive) return adaptive_flow(scene, attempt, is_valid, x, u, p, h, control, after);
  if (is_valid && !is_valid(scene, x, u, 0, h)) return 0;
  CALL(step, (x, u, p, &length), (after));
  return within_reach(scene, after) && (!is_valid || is_valid(scene, x, u, after, h));
}
