/* SPDX-License-Identifier: Apache-2.0
 *
 * Many ticks in one call. The torque is constant within a tick.
 *
 * Required definitions: flow.h and the generated `actuate`; in a scene with events also events.h, which defines EVENTS.
 */

#include "flow.h"
#include "events.h"

#ifndef EVENTS
typedef void report_t;

/* Without events a tick is one smooth motion. */
static int tick(const real* x, const real* u, const real* p, double h, control_t* control, report_t* report, real* after) {
  (void)report;
  return flow(x, u, p, h, control, after);
}

static long long time_stepped(const report_t* report) {
  (void)report;
  return 0;
}
#endif

/* Advance `ticks` ticks of length h from x, in place.
 *
 * command: command of the first tick; that of the next tick is `stride` numbers further (0: constant).
 * trace:   state after every tick.                   effort: effective command in every tick, limits applied.
 * notes:   estimated error of q after every tick, and number of time-stepped ticks.
 * control: error control, or null.
 * Returns the number of computed ticks; x is the state after the last of them.
 */
EXPORTED long long roll(real* x, const real* command, long long stride, const real* p, double h, long long ticks, real* trace,
                        real* effort, real* notes, control_t* control, report_t* report) {
  real next[NX], acted[NU];
  WORKSPACE;
  for (long long k = 0; k < ticks; ++k) {
    arg[0] = x;
    arg[1] = command + k * stride;
    res[0] = acted;
    actuate(arg, res, iw, w, 0);
    if (!tick(x, acted, p, h, control, report, next)) return k;
    for (int i = 0; i < NX; ++i) x[i] = next[i];
    for (int i = 0; i < NX; ++i) trace[k * NX + i] = next[i];
    for (int i = 0; i < NU; ++i) effort[k * NU + i] = acted[i];
    notes[2 * k] = control ? control->error : 0.0;
    notes[2 * k + 1] = time_stepped(report);
  }
  return ticks;
}
