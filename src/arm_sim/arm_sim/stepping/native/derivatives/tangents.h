/* SPDX-License-Identifier: Apache-2.0
 *
 * Generated functions of columns, see columns.h: what tangents are propagated by.
 */
#pragma once
#include "scene.h"

#include "columns.h"

typedef void column_equation_t(const real* c, const column* const* arg, column* res);

/* Those that a scene does not need are null. c: coefficients; dx, dw: columns of tangents; row: of a derivative.
 *
 * jvp:           (c, dx, dw) -> dx at the end of a step, see step_tangent.py; command_jvp: (c, dx, dr) -> that of the command.
 * vjp_q:         (c, row for positions) -> its product with the derivatives of a tick; vjp_rest: for the other states.
 * moving_...:    the same in motion.
 * propagate:     as jvp, of a step whose length varies as well: (c, dx, dw, dh) -> dx at its end.
 * project_begin: (c, dx) -> dx with what is held at rest; project_end: (c, dx, dx at the end) -> dx with contacts closed.
 */
typedef struct {
  column_equation_t *jvp, *command_jvp, *vjp_q, *vjp_rest, *moving_jvp, *moving_vjp_q, *moving_vjp_rest, *propagate;
  column_equation_t *project_begin, *project_end;
} tangents_t;

/* Columns of the arms and what else is asked of their ticks. Python: Columns.
 *
 * initial:              columns of x at the beginning, NX rows for each arm
 * inputs:               columns of commands and parameters, NU + NT rows for each arm and tick
 * columns:              receives columns of x, NX rows for each arm and tick
 * ..._arm_stride:       numbers from an arm to the next; 0 where they are shared
 * ..._tick_stride:      numbers from a tick to the next; 0 where they are shared
 * count:                number of columns
 * starts_from_identity: whether the columns at the beginning, above those of the first tick, are a unit matrix: the first tick
 *                       is then differentiated row by row, of which there are fewer
 * initial_state_varied: in a scene with events, whether the state at the beginning is not one reached in motion
 * ticks_before_event:   receives the ticks of each arm before one with an event, in a scene with events
 * after:                receives states at the end
 */
typedef struct {
  const double *initial, *inputs;
  double* columns;
  long long initial_arm_stride, inputs_arm_stride, inputs_tick_stride, columns_arm_stride, columns_tick_stride, count;
  int starts_from_identity, initial_state_varied;
  long long* ticks_before_event;
  double* after;
} columns_t;
