/* SPDX-License-Identifier: Apache-2.0
 *
 * What the engine asks of a scene. When one is compiled, its own definitions and generated functions come before this file,
 * see engine.py. Read alone, as editors and checks of these files do, it is a scene with everything: two joints with dry
 * friction and stops, a drive with a state, a bilateral constraint and two contacts, under error control.
 */
#pragma once
#include <math.h>
#include <string.h>

#ifndef NX
#define ALONE

/* What the generated code begins with; see codegen/native/scalar.h. */
typedef double real;
#define casadi_int long long
#define BEYOND(x, limit) (!(fabs(x) <= (limit)))
static inline long long AS_BITS(real x) {
  long long b;
  memcpy(&b, &x, sizeof b);
  return b;
}
#define LANES 1
#define LANE(x, i) (*((void)(i), &(x)))

/* Sizes: states, joints, tunable numbers, contacts; switches of drives and cords, joints with a direction of friction and
 * with compliant stops (all or none); whether there are bilateral constraints, and their rows; numbers of a command. */
#define NX 5
#define NU 2
#define NP 3
#define NC 2
#define NK 1
#define ND NU
#define NQ NU
#define NB 1
#define NM 1
#define NR NU
#define LARGEST 1e100 /* number of a state */

/* Work space of the generated functions. */
#define SZ_ARG 16
#define SZ_RES 16
#define SZ_IW 16
#define SZ_W 256

/* Features, 1 or 0: error control, with the order of its estimate plus one and the most sub-steps of a tick; and others. */
#define ADAPTIVE 1
#define ORDER 4
#define MOST_SUBSTEPS 1000
#define EVENTS 1
#define STOPS 1      /* stops are looked at after a tick, where there are no events */
#define RIGID 1      /* joints have rigid stops */
#define FREE 1       /* functions without modes while no joint is at a stop */
#define MOVING 1     /* simpler functions where every joint slides and nothing touches */
#define PLAIN 1      /* modes are those of sliding joints and of contacts alone */
#define SHORTCUT 1      /* ticks that clearly have no event are made without modes */
#define DENSE_DERIVATIVE 1  /* derivatives of steps return their continuous output */
#define NEAR_LOADS 1 /* steps return the loads at a stage at their end */
#define INDETERMINATE 1   /* statics may not determine the reactions of what is held */
#define TOLERANCE 1e-8

/* Of derivatives: numbers of coefficients, of varied parameters, and of coefficients of projections. */
#define NA 4
#define NSTEP 4
#define NT 1
#define NBEGIN 4
#define NEND 4
#define NG 14

/* Of penetration, and of slow sliding. */
#define DEEP 1e-9
#define SLOWEST 1e-9

/* Generated functions. One that a scene does not need is empty, and never called. */
#define GENERATED(name) int name(const real** arg, real** res, casadi_int* iw, real* w, int mem)
GENERATED(step);
GENERATED(free_step);
GENERATED(attempt);
GENERATED(free_attempt);
GENERATED(moving_step);
GENERATED(moving_attempt);
GENERATED(rhs);
GENERATED(actuate);
GENERATED(loads);
GENERATED(bilateral);
GENERATED(pressures);
GENERATED(switches);
GENERATED(strike);
GENERATED(statics);
GENERATED(contact_geometry);
GENERATED(contact_inertia);
GENERATED(contact_close);
GENERATED(acting);
GENERATED(mode_margin);
GENERATED(mode_margin_in_motion);
GENERATED(guards);
GENERATED(guard_gradient);
GENERATED(motion);
GENERATED(doubts);
GENERATED(settled);
GENERATED(impact_laws);
GENERATED(across);
GENERATED(at_rest);
GENERATED(closing);
GENERATED(rest_begin);
GENERATED(rest_end);
GENERATED(begin_adjoint);
GENERATED(end_adjoint);
GENERATED(adjoint);
GENERATED(limit_adjoint);
GENERATED(advance);
GENERATED(moving_advance);
#define TICK step
#endif
