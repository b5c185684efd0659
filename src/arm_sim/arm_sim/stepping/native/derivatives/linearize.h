/* SPDX-License-Identifier: Apache-2.0
 *
 * What derivatives of a tick need, for other compiled code. Python reads this header, see python_linearize.py.
 */
#pragma once

typedef int (*differentiate_t)(const void*, const void*, const void*, const double*, const double*, const double*, double,
                               double*, double*);

/* The function `differentiate_tick` of tick_derivative.c, and what it takes besides state and command. */
typedef struct {
  differentiate_t differentiate;
  const void *scene, *tangents, *engine;
  const double* p;
  double dt;
} linearize_t;
