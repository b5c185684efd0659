/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of an arm, one or many in one call.
 */

#include "arm/arm.h"

#include "arm/tick.h"

EXPORTED int arm_tick(arm_t* arm) {
  const scene_t* scene = arm->scene;
  const control_t* control = arm->control;
  const report_t* report = arm->report;
  real acted[NU];
  if (!actuated_tick(scene, arm->x, arm->command, arm->p, arm->dt, arm->control, arm->report, acted)) return 0;
  copy(arm->acted, acted, NU);
  arm->notes[0] = control ? control->error : 0.0;
  arm->notes[1] = (double)report->time_stepped;
  return 1;
}

/* Advance by some ticks; returns the number of computed ones.
 *
 * commands: that of the first tick; that of the next is `stride` numbers further (0: constant).
 * trace, effort, notes: receive the state after every tick, the command that acted, limits applied, and the arm's notes.
 */
EXPORTED long long arm_ticks(const arm_t* arm, long long ticks, double* commands, long long stride, double* trace,
                             double* effort, double* notes) {
  const scene_t* scene = arm->scene;
  arm_t row = *arm;
  for (long long k = 0; k < ticks; ++k) {
    row.command = commands + k * stride;
    row.acted = effort + k * NU;
    row.notes = notes + 2 * k;
    if (!arm_tick(&row)) return k;
    copy(trace + k * NX, row.x, NX);
  }
  return ticks;
}
