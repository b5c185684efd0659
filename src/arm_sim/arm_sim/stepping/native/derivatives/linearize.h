/* SPDX-License-Identifier: Apache-2.0
 *
 * What derivatives of a tick need, for other compiled code. Python reads this header, see python_linearize.py.
 */
#pragma once

/* The function `differentiate_tick` of tick_derivative.c, and what it takes besides state and command. */
typedef struct {
  int (*differentiate)(const void*, const void*, const void*, const double*, const double*, const double*, double, double*,
                       double*);
  const void *scene, *tangents, *engine;
  const double* p;
  double dt;
} linearize_t;
