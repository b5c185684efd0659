/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick of a scene with events, by the cheapest method that serves it.
 */

#pragma once
#include "events/free_motion.h"
#include "events/predicted_tick.h"
#include "events/shortcut.h"

/* A tick of length h from x under a command that acts, its limits applied: 0 if it cannot be computed, see the report. */
static int cheapest_tick(const scene_t* scene, const real* x, const real* u, const real* p, double h, control_t* control,
                         report_t* report, real* after) {
  LOCAL(beginning_t, start, beginning_of, BEGINNING);
  report->trouble = NONE;
  if (scene->has_free_equations && flow(scene, scene->free_step, scene->free_attempt, stays_free, x, u, p, h, control, after))
    return 1;
  if (scene->has_shortcut && event_free_shortcut(scene, x, u, p, h, &start, after)) return 1;
  LOCAL_TICK(segment, u, p, NP);
  segment.control = control;
  /* What the shortcut has computed is not computed again, by the same functions: where the contacts are, or without contacts
   * the loads, whose modes are then the engine's. */
  if (scene->has_shortcut && NC) keep_geometry(scene, x, segment.memory, start.place);
  else if (start.any_held) keep_loads(scene, x, start.p.all + NP, segment.memory, &start.loads);
  report->trouble = tick_with_events(scene, x, &segment, h, report, 0, after);
  return report->trouble == NONE;
}
