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

/* Advance by some ticks from each of many states, in place and as after a restart; NaN where a tick cannot be computed.
 *
 * x, commands, p: NX, NU and NP numbers for each state, its command held.
 * lost:           receives the energies lost in impacts.
 */
EXPORTED void arm_each(const arm_t* arm, long long states, double* x, double* commands, const double* p, long long ticks,
                       double* lost) {
  const scene_t* scene = arm->scene;
  const report_t* report = arm->report;
  control_t* control = arm->control;
  arm_t own = *arm;
  for (long long k = 0; k < states; ++k) {
    const double before = report->impact_loss;
    long long done = 0;
    own.x = x + k * NX;
    own.command = commands + k * NU;
    own.p = p + k * NP;
    if (control) control->step = 0.0;
    while (done < ticks && arm_tick(&own)) ++done;
    lost[k] = report->impact_loss - before;
    for (int i = 0; i < NX && done < ticks; ++i) own.x[i] = lost[k] = NAN;
  }
}
