/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of an arm: one or many in one call, and traced ones.
 */

#include "arm/arm.h"

#include "arm/tick.h"
#include "arm/traced_tick.h"

/* Advance by some ticks; returns the number of computed ones.
 *
 * commands: that of the first tick; that of the next is `stride` numbers further (0: constant).
 * trace, effort, notes: receive the state after every tick, the command that acted, limits applied, and the arm's notes.
 */
EXPORTED long long arm_ticks(const arm_t* arm, long long ticks, const double* commands, long long stride, double* trace,
                             double* effort, double* notes) {
  const scene_t* scene = arm->scene;
  control_t* control = arm->control;
  report_t* report = arm->report;
  const double* x = arm->x;
  long long k = 0;
  for (; k < ticks; ++k, x = trace, trace += NX) {
    const double* command = commands + k * stride;
    if (!actuated_tick(scene, x, command, arm->p, arm->dt, control, report, effort + k * NU, trace)) break;
    notes[2 * k] = control ? control->error : 0.0;
    notes[2 * k + 1] = (double)report->time_stepped;
  }
  if (k) copy(arm->x, x, NX);
  return k;
}

/* See arm_t.tick. */
EXPORTED int arm_tick(arm_t* arm) {
  const scene_t* scene = arm->scene;
  real acted[NU], after[NX];
  if (!arm_ticks(arm, 1, arm->command, 0, after, acted, arm->notes)) return 0;
  copy(arm->acted, acted, NU);
  return 1;
}

/* See traced_tick.h. */
EXPORTED int trace_tick(const scene_t* scene, const real* x, const real* u, const real* p, double h, control_t* control,
                        trace_t* trace, real* after) {
  report_t report = {0};
  LOCAL_TICK(segment, u, p, NP);
  segment.control = control;
  return tick_with_events(scene, x, &segment, h, &report, trace, after) == NONE;
}
