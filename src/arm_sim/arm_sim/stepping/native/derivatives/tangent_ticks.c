/* SPDX-License-Identifier: Apache-2.0
 *
 * Propagation of tangents over ticks of smooth motion; in a scene with events over those without one, in their modes. With
 * DENSE_DERIVATIVE the derivative of a step also returns its continuous output, and the engine need not make the step again.
 */

#include "derivatives/event_free_ticks.h"
#include "derivatives/tangent_columns.h"

/* Columns of the state in which a tick begins, with what is held at rest. */
static void begin_columns(const event_free_lanes_t* tick, const real* coefficients, column* dx) {
  column begun[NX];
  const column* const given[1] = {dx};
  if (!tick->held) return;
  begin_at_rest(coefficients, given, begun);
  memcpy(dx, begun, sizeof begun);
}

/* Columns of the state after a tick from those at its beginning and those that the step has reached. */
static void end_columns(const event_free_lanes_t* tick, const real* coefficients, const column* dx, const column* dw,
                        column* moved) {
  column ended[NX];
  const column* const given[3] = {dx, moved, dw};
  if (!tick->closed) return;
  end_at_rest(coefficients, given, ended);
  memcpy(moved, ended, sizeof ended);
}

/* Coefficients of the projections at the beginning and at the end of a tick. */
static void find_rest(const real* u, const event_free_lanes_t* tick, real* begin, real* end) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  arg[0] = tick->begin;
  arg[1] = u;
  arg[2] = tick->p;
  res[0] = begin;
  if (tick->held) rest_begin(arg, res, iw, w, 0);
  arg[1] = tick->end;
  res[0] = end;
  if (tick->closed) rest_end(arg, res, iw, w, 0);
}
/* Simpler functions where nothing is held and nothing touches. */
#define IN_MODES(function, in_motion) (MOVING && !tick.held ? in_motion : function)

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
  const real length = h[0];
  for (long long arm = first; arm < last; arm += LANES) {
    real x[NX], next[NX], r[NU], u[NU], par[NP + 1], w[SZ_W], limits[NA + NSTEP];
    real* const derivatives = limits + NA;
    column dx[NX], dr[NU + NT], dw[NU + NT], moved[NX + NU + NT];
    casadi_int iw[SZ_IW];
    const real* arg[SZ_ARG];
    real* res[SZ_RES];
    long long of_lane[LANES];
    choose_arms(arm, last, of_lane);
    read_arms(x, NX, x0, NX, of_lane);
    read_arms(par, NP, p, p_arm, of_lane);
    event_free_lanes_t tick;
    prediction_t begun[LANES];
    real rest[NBEGIN + 1], returning[NEND + 1], place[PLACES + 1], inside[3 * NX];
    int event_free[LANES], any = 1;
    tick.held = tick.closed = 0;
    for (int j = 0; EVENTS && j < LANES; ++j) {
      event_free[j] = 1;
      done[of_lane[j]] = 0;
    }
    for (long long k = 0; k < ticks && !HALTED; ++k) {
      double* reached = columns + k * columns_tick;
      read_arms(r, NU, tau + k * tau_tick, tau_arm, of_lane);
      arg[0] = x;
      arg[1] = r;
      res[0] = u;
      res[1] = limits;
      acting(arg, res, iw, w, 0);
      arg[0] = x;
      arg[1] = u;
      arg[2] = par;
      arg[3] = &length;
      res[0] = next;
      res[1] = derivatives;
      if (EVENTS) {
        begin_ticks(x, u, par, &length, begun, place);
        if (DENSE_DERIVATIVE) {
          predict_modes(engine, begun, &tick);
          arg[2] = tick.p;
          for (int i = 0; i < 3; ++i) res[2 + i] = inside + i * NX;
          IN_MODES(advance, moving_advance)(arg, res, iw, w, 0);
          find_places(next, place);
          write_steps(next, inside, place, begun);
        }
        make_event_free(begun, x, u, engine, begins && !k, event_free, &tick);
        for (int j = any = 0; j < LANES; ++j) {
          any |= event_free[j];
          if (event_free[j]) done[of_lane[j]] = k + 1;
          else met[of_lane[j]] = 1;
        }
        if (!any) break;
        find_rest(u, &tick, rest, returning);
        arg[0] = tick.begin;
        arg[2] = tick.p;
      }
      if (!EVENTS || !tick.predicted) IN_MODES(advance, moving_advance)(arg, res, iw, w, 0);
      if (EVENTS) memcpy(next, tick.after, sizeof next);
      const int by_rows = unit && !k && !tick.held;
      for (int part = 0; by_rows && part < 2; ++part) {
        const int start = part ? NU : 0, end = part ? NX : NU;
        const column* weights[1] = {dx};
        for (int row = start; row < end; row += WIDTH) {
          take(dx, given + start * count, of_lane, given_arm, end - start, count, row);
          (part ? IN_MODES(back_rest, moving_back_rest) : IN_MODES(back_q, moving_back_q))(limits, weights, moved);
          put_rows(moved, reached, of_lane, columns_arm, end, NX + NU + NT, row);
        }
      }
      for (long long c = 0; !by_rows && c < count; c += WIDTH) {
        const column* given_columns[2] = {dx, dr};
        const column* acting_columns[2] = {dx, dw};
        if (k) take(dx, reached - columns_tick, of_lane, columns_arm, NX, count, c);
        else take(dx, given, of_lane, given_arm, NX, count, c);
        take(dr, pushed + k * pushed_tick, of_lane, pushed_arm, NU + NT, count, c);
        limit(limits, given_columns, dw);
        for (int i = NU; i < NU + NT; ++i) dw[i] = dr[i];
        begin_columns(&tick, rest, dx);
        IN_MODES(carry, moving_carry)(derivatives, acting_columns, moved);
        end_columns(&tick, returning, dx, dw, moved);
        put(moved, reached, of_lane, columns_arm, NX, count, c);
      }
      for (int j = 0; j < LANES; ++j)
        for (int i = 0; STOPS && i < NU; ++i) {
          const double q = LANE(x[i], j), v = LANE(x[NU + i], j), end = LANE(next[i], j), v_end = LANE(next[NU + i], j);
          const double near_by = 1e-6 * h[0] * (__builtin_fabs(v) + __builtin_fabs(v_end)) + 1e-9 * (1.0 + __builtin_fabs(q));
          if (meets_stop(q, v, end, v_end, h[0], near_by, i)) met[of_lane[j]] = 1;
        }
      for (int i = 0; i < NX; ++i) x[i] = next[i];
    }
    for (int j = 0; j < LANES; ++j) {
      met[of_lane[j]] |= !within_reach(x, j);
      for (int i = 0; i < NX; ++i) after[of_lane[j] * NX + i] = LANE(x[i], j);
    }
  }
}
