/* SPDX-License-Identifier: Apache-2.0
 *
 * A scene with everything, for editors and for checks of these files: two joints with dry friction and stops, a drive with a
 * state, a bilateral constraint and two contacts, under error control. When a scene is compiled, its own definitions and
 * generated functions take the place of this file; see `source` in engine.py.
 */
#pragma once
#include <math.h>
#include <string.h>

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
 * with compliant stops; whether there are bilateral constraints, and their rows. */
#define NX 5
#define NU 2
#define NP 3
#define NC 2
#define NK 1
#define ND NU
#define NQ NU
#define NB 1
#define NM 1
#define LARGEST 1e100

/* Work space of the generated functions, and their costs. */
#define SZ_ARG 16
#define SZ_RES 16
#define SZ_IW 16
#define SZ_W 256
#define MOST_WORK 1000000LL
#define COST_STEP 400
#define COST_SLOPE 100
#define COST_LOADS 100
#define COST_INERTIA 100
#define COST_STRIKE 100
#define COST_STATICS 100

/* Features. */
#define ADAPTIVE 1
#define ORDER 4
#define MOST_SUBSTEPS 1000
#define TOLERANCE 1e-8
#define RIGID 1
#define FREE 1
#define MOVING 1
#define CALM 1
#define CLEAR 1
#define FORETELLS 1
#define NEAR_LOADS 1
#define TOGETHER 1
#define STOPS 1

/* How a number of the scene is declared. */
#define OF_SCENE static const
#define VALUE(...) = __VA_ARGS__

/* Brace lists by joint, and by contact. */
#define LOWEST {-1.0, -1.0}
#define HIGHEST {1.0, 1.0}
#define LOWER {-1.0, -1.0}
#define UPPER {1.0, 1.0}
#define LOWER_REBOUND {0.0, 0.0}
#define UPPER_REBOUND {0.0, 0.0}
#define SOFT_LOWER {-1.0, -1.0}
#define SOFT_UPPER {1.0, 1.0}
#define STATIC {1.0, 1.0}
#define FRICTION {0.5, 0.5}
#define HOLDING {0.6, 0.6}
#define RESTITUTION {0.0, 0.0}
#define WAVES {2.0, 2.0}

/* Of derivatives: numbers of coefficients, of varied parameters, and of coefficients of projections. */
#define NA 4
#define NSTEP 4
#define NT 1
#define STRETCH 1
#define NBEGIN 4
#define NEND 4
#define NG 14

/* Of penetration, and of slow sliding. */
#define DEEP 1e-9
#define SLOWEST 1e-9

/* Generated functions. */
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
GENERATED(clear);
GENERATED(clear_in_motion);
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
#define TICK step
