/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick with events of which all segments are recorded.
 */

#pragma once
#include "modes/tick_record.h"
#include "motion/flow.h"

/* A tick of length h from x under commands that act: 0 if it cannot be computed. */
EXPORTED int trace_tick(const scene_t* scene, const real* x, const real* u, const real* p, double h, control_t* control,
                        trace_t* trace, real* after);
