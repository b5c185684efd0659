/* SPDX-License-Identifier: Apache-2.0
 *
 * An arm that is advanced tick by tick, for other compiled code. Python reads this header, see arm.py.
 */
#pragma once

/* An arm and its memory. Times are in [s], other units those of the scene. */
typedef struct arm {
  int (*tick)(struct arm*); /* advances by a tick: 0 if it cannot be computed, and then all is kept */
  const void* scene;
  double *x, *command, *acted; /* state; command of the next tick; command that acted in the last tick, limits applied */
  double* notes;               /* estimated error of q, and number of time-stepped ticks */
  const double* p;             /* tunable numbers */
  double dt;                   /* length of a tick in [s] */
  void *control, *report;      /* error control, or null; totals, see report.h */
} arm_t;
