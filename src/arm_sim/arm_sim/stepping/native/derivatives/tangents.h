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

/* Columns of the arms and what else is asked of their ticks. Python: Columns. */
typedef struct {
  const double* initial;              /* columns of x at the beginning, NX rows for each arm */
  const double* held;                 /* columns of commands and parameters, NU + NT rows for each arm and tick */
  double* columns;                    /* receives columns of x, NX rows for each arm and tick */
  /* Numbers from an arm to the next, and from a tick to the next; 0 where it is shared. */
  long long initial_arm_stride, held_arm_stride, held_tick_stride, columns_arm_stride, columns_tick_stride;
  long long count; /* of columns */
  int starts_from_identity; /* whether those at the beginning, above those of the first tick, are a unit matrix: the first tick
                               is then differentiated row by row, of which there are fewer */
  int initial_state_varied; /* in a scene with events, whether the state at the beginning is not one reached in motion */
  long long* ticks_before_event; /* of each arm, in a scene with events */
  double* after; /* receives states at the end */
} columns_t;
