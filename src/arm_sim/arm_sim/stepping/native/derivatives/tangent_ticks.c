/* SPDX-License-Identifier: Apache-2.0
 *
 * Propagation of tangents over ticks of smooth motion; in a scene with events over those without one, in their modes. Where
 * has_dense_derivative is set, the derivative of a step also returns its continuous output, and the engine need not make the step
 * again.
 */

#include "derivatives/event_free_ticks.h"
#include "derivatives/tangent_columns.h"

/* Arms side by side in a tick: which, their states at its beginning and end, effective commands and tunable numbers. */
typedef struct {
  const tangents_t* tangents;
  long long of_lane[LANES];
  real *x, *next, *u, *p, length;
  real* limits; /* coefficients of the limits, and then of the step */
  real *at_begin, *at_end; /* in a scene with events, coefficients of the projections at the ends of the motion */
  event_free_lanes_t tick; /* in a scene with events, modes and ends of the motion */
  int event_free[LANES];   /* whether the tick of a lane has no event */
} tangent_group_t;
#define GROUP (2 * NX + NU + NP + NA + NSTEP + NBEGIN + NEND + EVENT_FREE_LANES)

static tangent_group_t group_of(const scene_t* scene, real* numbers) {
  real *u = numbers + 2 * NX, *limits = u + NU + NP, *at_begin = limits + NA + NSTEP, *at_end = at_begin + NBEGIN;
  tangent_group_t group = {
      .x = numbers, .next = numbers + NX, .u = u, .p = u + NU, .limits = limits, .at_begin = at_begin, .at_end = at_end};
  group.tick = event_free_lanes_of(scene, at_end + NEND);
  return group;
}

/* The functions of a step: the simpler ones where nothing is held and nothing touches. */
typedef struct {
  equation_t* advance;
  column_equation_t *jvp, *vjp_q, *vjp_rest;
} tangent_set_t;

static tangent_set_t tangent_set_of(const scene_t* scene, const tangent_group_t* group) {
  const tangents_t* t = group->tangents;
  const tangent_set_t in_modes = {scene->advance, t->jvp, t->vjp_q, t->vjp_rest};
  const tangent_set_t in_motion = {scene->moving_advance, t->moving_jvp, t->moving_vjp_q, t->moving_vjp_rest};
  return scene->moving_advance && !group->tick.any_held ? in_motion : in_modes;
}

/* The step from x in modes p, with the coefficients of its derivative, and its dense output if that is asked for. */
static void make_step(const scene_t* scene, tangent_group_t* group, const real* x, const real* p, real* dense) {
  CALL(tangent_set_of(scene, group).advance, (x, group->u, p, &group->length),
       (group->next, group->limits + NA, dense, dense ? dense + NX : 0, dense ? dense + 2 * NX : 0));
}

/* Begin the ticks of a group. Where the derivative of a step also tells all that the engine of one arm asks of a step, steps
 * are made here, in predicted modes, for it to take. */
static void begin_group(const scene_t* scene, tangent_group_t* group, const engine_t* engine, prediction_t* ticks) {
  real place[PLACES + 1], dense[3 * NX];
  begin_ticks(scene, group->x, group->u, group->p, &group->length, ticks, place);
  if (!scene->has_dense_derivative) return;
  predict_modes(scene, engine, ticks, &group->tick);
  make_step(scene, group, group->x, group->tick.p, dense);
  find_places(scene, group->next, place);
  write_steps(scene, group->next, dense, 0, place, ticks);
}

/* Make tick k of the arms that have no event in it, with the coefficients of its derivative, and mark the others: 0 if those
 * are all. The engine of one arm finds their modes. */
static int make_event_free_ticks(const scene_t* scene, tangent_group_t* group, const arms_t* arms, const columns_t* to,
                                 long long k) {
  LOCAL_PREDICTIONS(ticks);
  const event_free_lanes_t* tick = &group->tick;
  int any = 0;
  begin_group(scene, group, arms->engine, ticks);
  make_event_free(scene, ticks, group->x, group->u, arms->engine, to->initial_state_varied && !k, group->event_free,
                  &group->tick);
  for (int j = 0; j < LANES; ++j) {
    any |= group->event_free[j];
    if (group->event_free[j]) to->ticks_before_event[group->of_lane[j]] = k + 1;
    else arms->unfinished[group->of_lane[j]] = 1;
  }
  if (!any) return 0;
  if (tick->any_held) CALL(scene->begin_coefficients, (tick->begin, group->u, tick->p), (group->at_begin));
  if (tick->any_closed) CALL(scene->end_coefficients, (tick->begin, tick->end, tick->p), (group->at_end));
  if (!tick->as_predicted) make_step(scene, group, tick->begin, tick->p, 0);
  copy(group->next, tick->after, NX);
  return 1;
}

/* The first tick row by row. Where the columns at the beginning are a unit matrix, see starts_from_identity, parts of it are
 * the weights by which transposed derivatives give rows of the result: those of positions by a function of their own, and then
 * those of the other numbers of the state. */
static void differentiate_by_rows(const scene_t* scene, const tangent_group_t* group, const columns_t* to) {
  column weight[NX], derivative[NX + NU + NT];
  const column* weights[1] = {weight};
  const tangent_set_t by = tangent_set_of(scene, group);
  const layout_t initial = {to->initial_arm_stride, to->count, group->of_lane};
  const layout_t columns = {to->columns_arm_stride, to->count, group->of_lane};
  for (int part = 0; part < 2; ++part) {
    const int start = part ? NU : 0, end = part ? NX : NU;
    for (int row = start; row < end; row += WIDTH) {
      read_columns(weight, to->initial + start * to->count, &initial, end - start, row);
      (part ? by.vjp_rest : by.vjp_q)(group->limits, weights, derivative);
      write_rows(derivative, to->columns, &columns, end, row);
    }
  }
}

/* Columns of the state after tick k from those before it, with what is held at rest and contacts that are closed. */
static void propagate_columns(const scene_t* scene, const tangent_group_t* group, const columns_t* to, long long k) {
  column dx[NX], dr[NU + NT], dw[NU + NT], moved[NX], projected[NX];
  const column *of_law[2] = {dx, dr}, *of_step[2] = {dx, dw}, *of_begin[1] = {dx}, *of_end[2] = {dx, moved};
  const tangents_t* by = group->tangents;
  const tangent_set_t step = tangent_set_of(scene, group);
  const layout_t inputs = {to->inputs_arm_stride, to->count, group->of_lane};
  const layout_t after = {to->columns_arm_stride, to->count, group->of_lane};
  const layout_t before = {k ? to->columns_arm_stride : to->initial_arm_stride, to->count, group->of_lane};
  double* end = to->columns + k * to->columns_tick_stride;
  const double* begin = k ? end - to->columns_tick_stride : to->initial;
  for (long long c = 0; c < to->count; c += WIDTH) {
    read_columns(dx, begin, &before, NX, c);
    read_columns(dr, to->inputs + k * to->inputs_tick_stride, &inputs, NU + NT, c);
    by->command_jvp(group->limits, of_law, dw);
    for (int i = NU; i < NU + NT; ++i) dw[i] = dr[i];
    if (group->tick.any_held) {
      by->project_begin(group->at_begin, of_begin, projected);
      memcpy(dx, projected, sizeof projected);
    }
    step.jvp(group->limits + NA, of_step, moved);
    if (group->tick.any_closed) by->project_end(group->at_end, of_end, projected);
    write_columns(group->tick.any_closed ? projected : moved, end, &after, NX, c);
  }
}

/* See tangent_columns.h. */
EXPORTED void propagate_ticks(const scene_t* scene, const tangents_t* tangents, const arms_t* arms, long long first,
                              long long last, const columns_t* to) {
  for (long long arm = first; arm < last; arm += LANES) {
    LOCAL(tangent_group_t, group, group_of, GROUP);
    real r[NU];
    group.tangents = tangents;
    group.length = arms->h;
    group.tick.any_held = group.tick.any_closed = 0;
    begin_lanes(scene, arms, arm, last, group.of_lane, group.p);
    read_arms(group.x, NX, arms->x0, NX, group.of_lane);
    for (int j = 0; j < LANES; ++j) {
      group.event_free[j] = 1;
      if (scene->eventful) to->ticks_before_event[group.of_lane[j]] = 0;
    }
    for (long long k = 0; k < arms->ticks && !is_halted(arms); ++k) {
      read_commands(arms, k, NU, group.of_lane, r);
      CALL(scene->acting, (group.x, r), (group.u, group.limits));
      if (!scene->eventful) make_step(scene, &group, group.x, group.p, 0);
      else if (!make_event_free_ticks(scene, &group, arms, to, k)) break;
      if (to->starts_from_identity && !k && !group.tick.any_held) differentiate_by_rows(scene, &group, to);
      else propagate_columns(scene, &group, to, k);
      mark_stops(scene, arms, group.of_lane, group.x, group.next, 1);
      copy(group.x, group.next, NX);
    }
    for (int j = 0; j < LANES; ++j) arms->unfinished[group.of_lane[j]] |= !is_lane_within_reach(scene, group.x, j);
    write_arms(to->after + arm * NX, NX, group.x, NX, lanes_used(arm, last));
  }
}
