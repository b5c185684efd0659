/* SPDX-License-Identifier: Apache-2.0
 *
 * Propagation of tangents over ticks of smooth motion; in a scene with events over those without one, in their modes. With
 * DENSE_DERIVATIVE the derivative of a step also returns its continuous output, and the engine need not make the step again.
 */

#include "derivatives/event_free_ticks.h"
#include "derivatives/tangent_columns.h"

/* Columns of the arms: those of the state at the beginning and of what is held (commands and parameters), for arms and ticks by
 * strides, and where those of the state after each tick go. */
typedef struct {
  const double *given, *pushed;
  double* columns;
  long long given_arm, pushed_arm, pushed_tick, columns_arm, columns_tick, count;
} columns_t;

/* Arms side by side in a tick. */
typedef struct {
  long long of_lane[LANES];
  real x[NX], next[NX], u[NU], p[NP + 1], length;
  real limits[NA + NSTEP];                   /* coefficients of the limits, and then of the step */
  event_free_lanes_t tick;                   /* in a scene with events: its modes and ends, ... */
  real at_begin[NBEGIN + 1], at_end[NEND + 1]; /* ... and coefficients of the projections there */
  int event_free[LANES];
} group_t;

/* Simpler functions where nothing is held and nothing touches. */
#define IN_MODES(group, function, in_motion) (MOVING && !(group)->tick.held ? in_motion : function)

static void find_commands(group_t* group, const real* r) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {group->x, r};
  real* res[SZ_RES] = {group->u, group->limits};
  acting(arg, res, iw, w, 0);
}

/* The step from x in modes p, with the coefficients of its derivative, and its dense output if that is asked for. */
static void make_step(group_t* group, const real* x, const real* p, real* dense) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, group->u, p, &group->length};
  real* res[SZ_RES] = {group->next, group->limits + NA};
  for (int i = 0; dense && i < 3; ++i) res[2 + i] = dense + i * NX;
  IN_MODES(group, advance, moving_advance)(arg, res, iw, w, 0);
}

/* Coefficients of the projections at the beginning and at the end of a tick. */
static void find_projections(group_t* group) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {group->tick.begin, group->u, group->tick.p};
  real* res[SZ_RES] = {group->at_begin};
  if (group->tick.held) rest_begin(arg, res, iw, w, 0);
  arg[1] = group->tick.end;
  res[0] = group->at_end;
  if (group->tick.closed) rest_end(arg, res, iw, w, 0);
}

/* Ticks without events: the number of arms that make one. The engine of one arm finds their modes, and takes the steps that are
 * made in predicted ones. `starts`: whether the beginning itself is varied. */
static int make_event_free_ticks(group_t* group, const engine_t* engine, int starts) {
  prediction_t begun[LANES];
  real place[PLACES + 1], dense[3 * NX];
  int count = 0;
  begin_ticks(group->x, group->u, group->p, &group->length, begun, place);
  if (DENSE_DERIVATIVE) {
    predict_modes(engine, begun, &group->tick);
    make_step(group, group->x, group->tick.p, dense);
    find_places(group->next, place);
    write_steps(group->next, dense, place, begun);
  }
  make_event_free(begun, group->x, group->u, engine, starts, group->event_free, &group->tick);
  for (int j = 0; j < LANES; ++j) count += group->event_free[j];
  if (!count) return 0;
  find_projections(group);
  if (!group->tick.predicted) make_step(group, group->tick.begin, group->tick.p, 0);
  memcpy(group->next, group->tick.after, sizeof group->next);
  return count;
}

/* The first tick row by row: derivatives of weighed sums of its end. */
static void differentiate_by_rows(const group_t* group, const columns_t* to) {
  column weight[NX], found[NX + NU + NT];
  const column* weights[1] = {weight};
  for (int part = 0; part < 2; ++part) {
    const int start = part ? NU : 0, end = part ? NX : NU;
    for (int row = start; row < end; row += WIDTH) {
      take(weight, to->given + start * to->count, group->of_lane, to->given_arm, end - start, to->count, row);
      if (part) IN_MODES(group, back_rest, moving_back_rest)(group->limits, weights, found);
      else IN_MODES(group, back_q, moving_back_q)(group->limits, weights, found);
      put_rows(found, to->columns, group->of_lane, to->columns_arm, end, NX + NU + NT, row);
    }
  }
}

/* Columns of the state after tick k from those before it, with what is held at rest and contacts that are closed. */
static void propagate_columns(const group_t* group, const columns_t* to, long long k) {
  column dx[NX], dr[NU + NT], dw[NU + NT], moved[NX], projected[NX];
  const column *given[2] = {dx, dr}, *acts[2] = {dx, dw}, *begun[1] = {dx}, *ended[3] = {dx, moved, dw};
  double* reached = to->columns + k * to->columns_tick;
  for (long long c = 0; c < to->count; c += WIDTH) {
    if (k) take(dx, reached - to->columns_tick, group->of_lane, to->columns_arm, NX, to->count, c);
    else take(dx, to->given, group->of_lane, to->given_arm, NX, to->count, c);
    take(dr, to->pushed + k * to->pushed_tick, group->of_lane, to->pushed_arm, NU + NT, to->count, c);
    limit(group->limits, given, dw);
    for (int i = NU; i < NU + NT; ++i) dw[i] = dr[i];
    if (group->tick.held) {
      begin_at_rest(group->at_begin, begun, projected);
      memcpy(dx, projected, sizeof projected);
    }
    IN_MODES(group, carry, moving_carry)(group->limits + NA, acts, moved);
    if (group->tick.closed) end_at_rest(group->at_end, ended, projected);
    put(group->tick.closed ? projected : moved, reached, group->of_lane, to->columns_arm, NX, to->count, c);
  }
}

/* Whether the arm in a lane comes near a stop in the tick. */
static int comes_near_stop(const group_t* group, double h, int lane) {
  int near = 0;
  (void)lane; /* alone */
  for (int i = 0; STOPS && i < NU; ++i) {
    const double q = LANE(group->x[i], lane), v = LANE(group->x[NU + i], lane);
    const double end = LANE(group->next[i], lane), v_end = LANE(group->next[NU + i], lane);
    const double margin = 1e-6 * h * (__builtin_fabs(v) + __builtin_fabs(v_end)) + 1e-9 * (1.0 + __builtin_fabs(q));
    near |= meets_stop(q, v, end, v_end, h, margin, i);
  }
  return near;
}

/* Propagate tangents of the arms first … last-1 over `ticks` ticks.
 *
 * x0:      initial states, NX an arm.                            after: receives states at the end.
 * tau:     commands, NU numbers; tick k of arm i at tau + i * tau_arm + k * tau_tick.
 * p:       parameters; arm i at p + i * p_arm.
 * given:   columns of x at the beginning, NX rows; arm i at given + i * given_arm.
 * pushed:  columns of commands and parameters, NU + NT rows; tick k of arm i at pushed + i * pushed_arm + k * pushed_tick.
 * unit:    whether those at the beginning, above those of the first tick, are a unit matrix. The first tick is then
 *          differentiated row by row, of which there are fewer.
 * columns: receives columns of x, NX rows; those after tick k of arm i at columns + i * columns_arm + k * columns_tick.
 * met:     set to 1 for an arm that comes near a stop or diverges; its results are invalid. In a scene with events set to 1
 *          for an arm that has one, or comes so close that it might: its state is then that before this tick, and of one
 *          lane also its columns.
 * engine, begins, done: in a scene with events, the engine of one arm, whether the state at the beginning is itself varied
 *          or has been reached in motion, and for every arm the number of ticks before the first with an event; else null.
 */
EXPORTED void carry_ticks(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
                          long long p_arm, const double* h, long long ticks, long long first, long long last,
                          const double* given, long long given_arm, const double* pushed, long long pushed_arm,
                          long long pushed_tick, int unit, long long count, double* after, double* columns,
                          long long columns_arm, long long columns_tick, signed char* met, const engine_t* engine, int begins,
                          long long* done) {
  const columns_t to = {given, pushed, columns, given_arm, pushed_arm, pushed_tick, columns_arm, columns_tick, count};
  for (long long arm = first; arm < last; arm += LANES) {
    group_t group;
    real r[NU];
    group.length = h[0];
    group.tick.held = group.tick.closed = 0;
    choose_arms(arm, last, group.of_lane);
    read_arms(group.x, NX, x0, NX, group.of_lane);
    read_arms(group.p, NP, p, p_arm, group.of_lane);
    for (int j = 0; EVENTS && j < LANES; ++j) {
      group.event_free[j] = 1;
      done[group.of_lane[j]] = 0;
    }
    for (long long k = 0; k < ticks && !HALTED; ++k) {
      read_arms(r, NU, tau + k * tau_tick, tau_arm, group.of_lane);
      find_commands(&group, r);
      const int any = EVENTS ? make_event_free_ticks(&group, engine, begins && !k) : 1;
      for (int j = 0; EVENTS && j < LANES; ++j) {
        if (group.event_free[j]) done[group.of_lane[j]] = k + 1;
        else met[group.of_lane[j]] = 1;
      }
      if (!any) break;
      if (!EVENTS) make_step(&group, group.x, group.p, 0);
      if (unit && !k && !group.tick.held) differentiate_by_rows(&group, &to);
      else propagate_columns(&group, &to, k);
      for (int j = 0; j < LANES; ++j)
        if (comes_near_stop(&group, h[0], j)) met[group.of_lane[j]] = 1;
      memcpy(group.x, group.next, sizeof group.x);
    }
    for (int j = 0; j < LANES; ++j) {
      met[group.of_lane[j]] |= !within_reach(group.x, j);
      for (int i = 0; i < NX; ++i) after[group.of_lane[j] * NX + i] = LANE(group.x[i], j);
    }
  }
}
