/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick of any scene. The torque is constant within it.
 */

#pragma once
#include "motion/flow.h"
#include "motion/report.h"

#if EVENTS
#include "events/events.h"
#else
/* Without events a tick is one smooth motion. */
static int tick(const real* x, const real* u, const real* p, double h, control_t* control, report_t* report, real* after) {
  (void)report;
  return flow(x, u, p, h, control, after);
}

/* Whether a contact point is inside its plane. */
static int is_penetrated(const real* x) {
  (void)x;
  return 0;
}
#endif

/* Advance by a tick of length h from x, in place: 0 if it cannot be computed, then x is kept.
 *
 * acted:   receives the effective command, limits applied.
 * control: error control, or null.
 */
static int actuated_tick(real* x, const real* command, const real* p, double h, control_t* control, report_t* report,
                         real* acted) {
  real next[NX];
  WORKSPACE;
  arg[0] = x;
  arg[1] = command;
  res[0] = acted;
  actuate(arg, res, iw, w, 0);
  if (!tick(x, acted, p, h, control, report, next)) return 0;
  for (int i = 0; i < NX; ++i) x[i] = next[i];
  return 1;
}
