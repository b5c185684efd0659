/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of an arm, one or many in one call.
 */

#include "arm/arm.h"

#include "arm/tick.h"

/* One tick from x, with what is noted of it. */
static int noted_tick(const arm_t* arm, const real* x, const real* command, real* acted, real* after, double* notes) {
  const scene_t* scene = arm->scene;
  control_t* control = arm->control;
  report_t* report = arm->report;
  if (!actuated_tick(scene, x, command, arm->p, arm->dt, control, report, acted, after)) return 0;
  notes[0] = control ? control->error : 0.0;
  notes[1] = (double)report->time_stepped;
  return 1;
}

EXPORTED int arm_tick(arm_t* arm) {
  const scene_t* scene = arm->scene;
  real acted[NU], after[NX];
  if (!noted_tick(arm, arm->x, arm->command, acted, after, arm->notes)) return 0;
  copy(arm->acted, acted, NU);
  copy(arm->x, after, NX);
  return 1;
}

/* Advance by some ticks; returns the number of computed ones.
 *
 * commands: that of the first tick; that of the next is `stride` numbers further (0: constant).
 * trace, effort, notes: receive the state after every tick, the command that acted, limits applied, and the arm's notes.
 */
EXPORTED long long arm_ticks(const arm_t* arm, long long ticks, const double* commands, long long stride, double* trace,
                             double* effort, double* notes) {
  const scene_t* scene = arm->scene;
  const double* x = arm->x;
  long long k = 0;
  for (; k < ticks && noted_tick(arm, x, commands + k * stride, effort + k * NU, trace + k * NX, notes + 2 * k); ++k)
    x = trace + k * NX;
  if (k) copy(arm->x, x, NX);
  return k;
}
