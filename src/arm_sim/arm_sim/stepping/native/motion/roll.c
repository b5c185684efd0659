/* SPDX-License-Identifier: Apache-2.0
 *
 * Many ticks in one call.
 */

#include "motion/tick.h"

/* Advance `ticks` ticks of length h from x, in place.
 *
 * command: command of the first tick; that of the next tick is `stride` numbers further (0: constant).
 * trace:   state after every tick.                   effort: effective command in every tick, limits applied.
 * notes:   estimated error of q after every tick, and number of time-stepped ticks.
 * control: error control, or null.
 * Returns the number of computed ticks; x is the state after the last of them.
 */
EXPORTED long long roll(const scene_t* scene, real* x, const real* command, long long stride, const real* p, double h,
                        long long ticks, real* trace, real* effort, real* notes, control_t* control, report_t* report) {
  real acted[NU];
  for (long long k = 0; k < ticks; ++k) {
    if (!actuated_tick(scene, x, command + k * stride, p, h, control, report, acted)) return k;
    for (int i = 0; i < NX; ++i) trace[k * NX + i] = x[i];
    for (int i = 0; i < NU; ++i) effort[k * NU + i] = acted[i];
    notes[2 * k] = control ? control->error : 0.0;
    notes[2 * k + 1] = (double)report->time_stepped;
  }
  return ticks;
}

/* Advance by `ticks` ticks from each of many states, in place and as after a restart; NaN where a tick cannot be computed.
 *
 * x, command, p: NX, NU and NP numbers for each state, its command held.
 * lost: receives the energies lost in impacts.
 */
EXPORTED void roll_each(const scene_t* scene, real* x, const real* command, const real* p, long long states, double h,
                        long long ticks, real* lost, control_t* control, report_t* report) {
  for (long long k = 0; k < states; ++k) {
    real trace[NX], effort[NU], notes[2], *own = x + k * NX;
    const double before = report->impact_loss;
    long long done = 0;
    if (control) control->step = 0.0;
    while (done < ticks && roll(scene, own, command + k * NU, 0, p + k * NP, h, 1, trace, effort, notes, control, report))
      ++done;
    lost[k] = report->impact_loss - before;
    for (int i = 0; i < NX && done < ticks; ++i) own[i] = lost[k] = __builtin_nan("");
  }
}
