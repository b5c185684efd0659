/* SPDX-License-Identifier: Apache-2.0
 *
 * The compiled tick of a simulation, for other compiled code. Python reads this header, see roll.py.
 */
#pragma once
#include <stdint.h>

typedef long long (*roll_t)(const void*, double*, const double*, long long, const double*, double, long long, double*, double*,
                            double*, void*, void*);

/* The function `roll` of roll.c, and its arguments in their order. */
typedef struct {
  roll_t roll;
  const void* scene;
  double* x;
  double* command;
  int64_t stride;
  const double* p;
  double dt;
  int64_t ticks;
  double *trace, *effort, *notes;
  void *control, *report;
} step_t;
