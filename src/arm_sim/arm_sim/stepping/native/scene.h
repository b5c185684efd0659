/* SPDX-License-Identifier: Apache-2.0
 *
 * A scene: what an arm brings to the engine. Generated code fills this structure, see scene_source.py; the engine only reads
 * it.
 *
 * Every function of the engine that needs the scene takes it as its first argument, `scene`. A unit for one scene alone may
 * define the sizes before this file, as exported libraries do: compilers then know the lengths of all arrays.
 */
#pragma once
#include "numerics/vectors.h"

/* A generated function: arguments, results, and its work space, see CasADi. */
typedef int equation_t(const real** arg, real** res, long long int* iw, real* w, int mem);

/* A scene. Numbers are in [rad], [m], [s], [N] and [N m]. */
typedef struct {
  /* Sizes, on which lengths of arrays depend. */
  int nx, nu, np; /* numbers of states, joints, tunable numbers */
  int nc, nm;     /* contacts, rows of bilateral constraints */
  int nd, nq;     /* joints with a direction of friction, and with compliant stops (all or none) */
  int nk, nr;     /* switches of drives and cords; numbers of a command */
  int na, nstep, nt, nbegin, nend, ng; /* of derivatives: coefficients of limits and steps, varied numbers, coefficients of
                                          projections at both ends, guards */
  int sz_w;     /* work space of the generated functions */

  /* What follows are no sizes: scene_source.py relies on `adaptive` being the first. */
  int adaptive, order, most_substeps; /* error control, if any: order of its estimate plus one, sub-steps of a tick */
  double tolerance;
  double largest; /* number of a state */
  double deep, slowest; /* penetration, and speed of sliding, that are rounding */

  int constrained; /* whether there are bilateral constraints, ... */
  int rigid; /* ... and rigid stops */
  int stops; /* whether stops are looked at after a tick, where there are no events */
  int free; /* whether there are functions without modes, for joints away from their stops, ... */
  int moving; /* ... and simpler functions where every joint slides and nothing touches */
  int joints_and_contacts_only; /* whether modes are those of sliding joints and of contacts alone */
  int event_free_shortcut; /* whether ticks that certainly have no event are made without modes */
  int near_loads; /* whether steps return the loads at a stage at their end */
  int dense_derivative; /* whether derivatives of steps return their continuous output */
  int indeterminate; /* whether statics may not determine the reactions of what is held */
  int eventful; /* whether there are events at all */

  /* Lower and upper stops, beyond every position where there is none: all, rigid ones with their restitution, compliant ones. */
  const double *stop_place[2], *rigid_stop[2], *rebound_of[2], *soft_stop[2];
  const double* static_level; /* of dry friction of joints */
  const double* wave_number; /* phase of the fastest wave in a joint's position, in radians for each radian or metre */
  const double *friction, *holding, *restitution; /* of contacts: coefficients of sliding and static friction */

  /* Operations of one call of functions, and those in a tick above which it is time-stepped. */
  long long step_cost, slope_cost, loads_cost, mobility_cost, impact_cost, statics_cost, most_work;

  /* Generated functions; those that a scene does not need are null. */
  equation_t *tick, *step, *attempt, *free_step, *free_attempt, *moving_step, *moving_attempt;
  equation_t *rhs, *actuate, *loads, *bilateral, *pressures, *switches, *impact_map, *statics;
  equation_t *contact_geometry, *contact_mobility, *contact_close;
  equation_t *acting, *mode_margin, *mode_margin_in_motion, *guards, *guard_gradient, *motion, *doubts, *settled;
  equation_t *impact_laws, *across, *at_rest, *closing, *nonsmooth, *begin_coefficients, *end_coefficients;
  equation_t *begin_adjoint, *end_adjoint, *adjoint, *limit_adjoint, *advance, *moving_advance;
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

/* Call a generated function: CALL(equation, (arguments), (results)); results that are not asked for are null.
 * Loops, not memcpy: that would read single stores back in one wide load, which waits for them. */
enum most { MOST_ARGUMENTS = 128 /* or results */, MOST_INTEGERS = 8 /* of its work space */ };
#define LIST(...) __VA_ARGS__
#define CALL(equation, arguments, results) \
  do { \
    const real* const inputs_[] = {LIST arguments}; \
    real* const outputs_[] = {LIST results}; \
    const real* arg[MOST_ARGUMENTS]; \
    real *res[MOST_ARGUMENTS], w[SZ_W] __attribute__((aligned(64))); \
    long long int iw[MOST_INTEGERS]; \
    for (size_t k_ = 0; k_ < sizeof inputs_ / sizeof *inputs_; ++k_) arg[k_] = inputs_[k_]; \
    for (size_t k_ = 0; k_ < sizeof outputs_ / sizeof *outputs_; ++k_) res[k_] = outputs_[k_]; \
    (equation)(arg, res, iw, w, 0); \
  } while (0)

#ifndef EXPORTED
#ifdef __cplusplus
#define EXPORTED extern "C" __attribute__((visibility("default")))
#else
#define EXPORTED __attribute__((visibility("default")))
#endif
#endif

/* A view names the parts of an array of numbers. LOCAL declares one and its array, which has an element more, since arrays of
 * no elements are an extension. */
#define LOCAL(type, name, view_of, count) \
  real name##_room[(count) + 1]; \
  type name = view_of(scene, name##_room)
