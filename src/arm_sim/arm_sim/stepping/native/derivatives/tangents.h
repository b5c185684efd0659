/* SPDX-License-Identifier: Apache-2.0
 *
 * Generated functions of columns, see columns.h: what tangents are propagated by.
 */
#pragma once
#include "scene.h"

#include "columns.h"

typedef void column_equation_t(const real* c, const column* const* arg, column* res);

/* Those that a scene does not need are null. */
typedef struct {
  column_equation_t *jvp, *command_jvp, *vjp_q, *vjp_rest, *moving_jvp, *moving_vjp_q, *moving_vjp_rest, *propagate;
  column_equation_t *begin_at_rest, *end_at_rest;
} tangents_t;

/* Columns of the arms and what else is asked of their ticks. Python: Columns. */
typedef struct {
  const double* given;  /* columns of x at the beginning, NX rows; arm i at given + i * given_arm */
  const double*
      pushed; /* columns of commands and parameters, NU + NT rows; tick k of arm i at strides like those of commands */
  double* columns;      /* receives columns of x, NX rows; those after tick k of arm i, likewise */
  long long given_arm, pushed_arm, pushed_tick, columns_arm, columns_tick, count;
  int unit; /* whether those at the beginning, above those of the first tick, are a unit matrix: the first tick is then
                      differentiated row by row, of which there are fewer */
  int begins; /* in a scene with events, whether the state at the beginning is itself varied, not reached in motion, ... */
  long long* done; /* ... and for every arm the number of ticks before the first with an event */
  double* after; /* receives states at the end */
} columns_t;
