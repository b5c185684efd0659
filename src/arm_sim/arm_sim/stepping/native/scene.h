/* SPDX-License-Identifier: Apache-2.0
 *
 * A scene: what an arm brings to the engine. Generated code fills this structure, see scene_source.py; the engine only reads
 * it.
 *
 * Every function of the engine that needs the scene takes it as its first argument, `scene`. A unit for one scene alone may
 * define the sizes before this file, as exported libraries do: compilers then know the lengths of all arrays.
 */
#pragma once
#include "generated_call.h"
#include "views.h"

/* A scene. Numbers are in [rad], [m], [s], [N] and [N m]. */
typedef struct {
  /* Sizes, on which lengths of arrays depend.
   *
   * nx, nu, np:         numbers of states, joints, tunable numbers
   * nc, nm:             contacts, rows of bilateral constraints
   * nd, nq:             joints with a direction of friction, and with compliant stops (all or none)
   * nk, nr:             switches of drives and cords; numbers of a command
   * na, nstep:          coefficients of the derivatives of limits and steps
   * nt, ng:             varied numbers and guards of derivatives
   * nbegin, nend:       coefficients of the projections at both ends of a motion
   * sz_w:               work space of the generated functions
   */
  int nx, nu, np, nc, nm, nd, nq, nk, nr, na, nstep, nt, nbegin, nend, ng, sz_w;

  /* What follows are no sizes: scene_source.py relies on `adaptive` being the first. */
  int adaptive;             /* whether the error of a tick is controlled */
  int order, substep_limit; /* under error control: order of the estimate plus one, most sub-steps of a tick */
  double tolerance;         /* under error control: largest scaled error of a sub-step */
  double largest;           /* largest magnitude that a state may reach */
  double penetration_limit; /* penetration of a plane that is rounding */
  double slowest;           /* speed of sliding up to which a contact is at rest */

  /* Features:
   *
   * constrained:              whether there are bilateral constraints
   * rigid:                    whether a joint has a rigid stop
   * has_stops_without_events: whether stops are looked at after a tick, as there are no events
   * has_free_equations:       whether there are functions without modes, for joints away from their stops
   * has_moving_equations:     whether there are simpler functions where every joint slides and nothing touches
   * joints_and_contacts_only: whether modes are those of sliding joints and of contacts alone
   * has_shortcut:             whether ticks that certainly have no event are made without modes
   * has_near_loads:           whether steps return the loads at a stage at their end
   * has_dense_derivative:     whether derivatives of steps return their continuous output
   * indeterminate:            whether statics may not determine the reactions of what is held
   * eventful:                 whether there are events at all
   */
  int constrained, rigid, has_stops_without_events, has_free_equations, has_moving_equations, joints_and_contacts_only;
  int has_shortcut, has_near_loads, has_dense_derivative, indeterminate, eventful;

  /* Lower and upper places of stops, beyond every position where there is none: all stops, rigid and compliant ones. */
  const double *stop_place[2], *rigid_stop[2], *soft_stop[2];
  const double* stop_restitution[2]; /* of rigid stops, lower and upper */
  const double* static_level;        /* of dry friction of joints */
  const double* wave_number; /* phase of the fastest wave in a joint's position, in radians for each radian or metre */
  const double *friction, *static_friction, *restitution; /* of contacts: coefficients of sliding and static friction */

  /* Operations of one call of functions, and those in a tick above which it is time-stepped. */
  long long step_cost, slope_cost, loads_cost, mobility_cost, impact_cost, statics_cost, work_limit;

  /* Generated functions; those that a scene does not need are null.
   *
   * Motion: a whole tick, and steps of fixed length or attempts under error control, in given modes, without modes, and where
   * everything slides. */
  equation_t *tick, *step, *attempt, *free_step, *free_attempt, *moving_step, *moving_attempt;
  /* At a state: x', effective command, loads, bilateral constraints, compliant stops, comparisons, impacts, statics. */
  equation_t *rhs, *actuate, *loads, *bilateral, *pressures, *switches, *impact_map, *statics;
  /* Contacts: where they are, their mobility, and states projected onto closed ones. */
  equation_t *contact_geometry, *contact_mobility, *contact_close;
  /* Derivatives at a state: of limits, distances to other modes, guards, x' at switches, and whether and how a state rests. */
  equation_t *acting, *mode_margin, *mode_margin_in_motion, *guards, *guard_gradient, *motion, *doubts, *settled;
  /* Derivatives of events: impacts, mobility across sliding, rest, closing, kinks; projections at both ends, and adjoints. */
  equation_t *impact_laws, *across, *at_rest, *closing, *nonsmooth, *begin_coefficients, *end_coefficients;
  equation_t *begin_adjoint, *end_adjoint;
  /* Derivatives of steps: adjoints of a step and of limits, steps with the coefficients of their derivatives. */
  equation_t *adjoint, *limit_adjoint, *advance, *moving_advance;
} scene_t;

#ifndef NX
#define NX (scene->nx)
#define NU (scene->nu)
#define NP (scene->np)
#define NC (scene->nc)
#define NM (scene->nm)
#define ND (scene->nd)
#define NQ (scene->nq)
#define NK (scene->nk)
#define NR (scene->nr)
#define NA (scene->na)
#define NSTEP (scene->nstep)
#define NT (scene->nt)
#define NBEGIN (scene->nbegin)
#define NEND (scene->nend)
#define NG (scene->ng)
#define SZ_W (scene->sz_w)
#endif

#define MC (3 * NC) /* forces of contacts */

#ifndef EVENTS /* whether the engine of events is compiled at all */
#define EVENTS 1
#endif
