/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick of any scene. The torque is constant within it.
 */

#pragma once
#include "motion/flow.h"
#include "motion/report.h"

#if EVENTS
#include "events/cheapest_tick.h"
#endif

/* A tick of length h from x under a command: 0 if it cannot be computed.
 *
 * control: error control, or null.
 * acted:   receives the effective command, limits applied.
 * after:   receives the state after the tick.
 */
static int actuated_tick(const scene_t* scene, const real* x, const real* command, const real* p, double h, control_t* control,
                         report_t* report, real* acted, real* after) {
  CALL(scene->actuate, (x, command), (acted));
#if EVENTS
  if (scene->eventful) return cheapest_tick(scene, x, acted, p, h, control, report, after);
#endif
  (void)report;
  return flow(scene, scene->step, scene->attempt, 0, x, acted, p, h, control, after);
}
