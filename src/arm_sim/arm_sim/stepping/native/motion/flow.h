/* SPDX-License-Identifier: Apache-2.0
 *
 * Smooth motion: one step of fixed length, or sub-steps under error control. */

#pragma once
#include "motion/step_control.h"

#include <math.h>

#define WORKSPACE \
  real w[SZ_W]; \
  casadi_int iw[SZ_IW]; \
  const real* arg[SZ_ARG]; \
  real* res[SZ_RES]
#ifndef EXPORTED
#define EXPORTED __attribute__((visibility("default")))
#endif

/* State of the error control between sub-steps. Python: SubstepControl. */
typedef struct {
  double tolerance; /* largest scaled error of a sub-step */
  double step;      /* next trial length; 0: unknown */
  double error;     /* sum of the estimated errors of q */
  long long attempts;
} control_t;

static int within_reach(const real* x) {
  int reached = 1;
  for (int i = 0; i < NX; ++i) reached &= !BEYOND(x[i], LARGEST);
  return reached;
}

/* Motion over h from x under u by sub-steps under error control. */
static int flow_controlled(const real* x, const real* u, const real* p, double h, control_t* c, real* after) {
  real next[NX], error, error_q, trial;
  WORKSPACE;
  substeps_t at = first_substep(h, c->step);
  for (int i = 0; i < NX; ++i) after[i] = x[i];
  for (long long k = 0; k < MOST_SUBSTEPS; ++k) {
    trial = next_length(&at, h);
    arg[0] = after;
    arg[1] = u;
    arg[2] = p;
    arg[3] = &trial;
    res[0] = next;
    res[1] = &error;
    res[2] = &error_q;
    attempt(arg, res, iw, w, 0);
    ++c->attempts;
    const enum outcome outcome = control_step(&at, h, error / c->tolerance, within_reach(next));
    if (outcome == STEP_TOO_SMALL) break;
    if (outcome == REJECTED) continue;
    for (int i = 0; i < NX; ++i) after[i] = next[i];
    c->error += error_q;
    if (outcome == ENDED) {
      c->step = at.step;
      return 1;
    }
  }
  return 0;
}

/* The same by one step of fixed length. */
static int flow_fixed(const real* x, const real* u, const real* p, double h, real* after) {
  WORKSPACE;
  const real length = h;
  arg[0] = x;
  arg[1] = u;
  arg[2] = p;
  arg[3] = &length;
  res[0] = after;
  step(arg, res, iw, w, 0);
  return within_reach(after);
}

/* Motion over h from x under u: 1 if every number stayed finite and, with error control, within the tolerance. */
static int flow(const real* x, const real* u, const real* p, double h, control_t* c, real* after) {
  return ADAPTIVE ? flow_controlled(x, u, p, h, c, after) : flow_fixed(x, u, p, h, after);
}
