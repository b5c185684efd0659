/* SPDX-License-Identifier: Apache-2.0
 *
 * Propagation of tangents of smooth motion in columns, see columns.h; where LANES > 1 a column holds those of LANES arms,
 * one per lane. Matrices of columns are stored by rows, `count` numbers per row.
 *
 * Required definitions: NX, NU (lengths of state and command), NP (of the parameters), NT (number of varied parameters),
 * SZ_ARG, SZ_RES, SZ_IW, SZ_W (work space of the generated functions), NSTEP and NA (numbers of coefficients of the derivatives
 * of a step and of the limits), and the generated `acting` (x, r) -> u and those NA, `limit` (columns dx, dr -> du),
 * `advance` (x, u, p, h) -> x and those NSTEP, `carry` (columns dx, dw -> dx, where dw is du and below it the change of
 * parameters), `back_q` and `back_rest` (of the coefficients of the limits, then those of the step: columns λ -> the
 * derivatives of λ · q, or of λ · the other states, after the tick by x, command and parameters, one below the other); with
 * STRETCH also `stretch` (columns dx, dw, dh -> dx); arms.h; where joints have stops stops.h, and STOPS.
 *
 * In a scene with events also EVENTS, NBEGIN and NEND (numbers of coefficients of the projections at the beginning and at the end
 * of a tick) and calm.h with what it requires; the generated `rest_begin` (x, u, p) -> those NBEGIN, `rest_end` (x, x at the end, p) -> those NEND,
 * `begin_at_rest` (columns dx -> dx) and `end_at_rest` (columns dx, dx at the end, dw -> dx at the end). Ticks without
 * events are differentiated then, in their modes; with FORETELLS `advance` also returns the continuous output of the step,
 * which the engine then need not make again; with MOVING by simpler functions of the same arguments where nothing is
 * held and nothing touches: `moving_advance`, `moving_carry`, `moving_back_q`, `moving_back_rest`.
 */

#include "scene_columns.h"
#include "arms.h"
#include "calm.h"

#include <string.h>

/* The matrix of arm j (of_lane[j]) begins at matrix + of_lane[j] * size. */
#if LANES == 1
static inline void take(column* to, const double* matrix, const long long* of_lane, long long size, int rows, long long count,
                        long long first) {
  for (int i = 0; i < rows; ++i) {
    const double* row = matrix + of_lane[0] * size + i * count + first;
    if (count - first >= WIDTH) memcpy(&to[i], row, sizeof(column));
    else
      for (int j = 0; j < WIDTH; ++j) to[i][j] = j < count - first ? row[j] : 0.0;
  }
}

static inline void put(const column* from, double* matrix, const long long* of_lane, long long size, int rows, long long count,
                       long long first) {
  for (int i = 0; i < rows; ++i) {
    double* row = matrix + of_lane[0] * size + i * count + first;
    if (count - first >= WIDTH) memcpy(row, &from[i], sizeof(column));
    else
      for (int j = 0; j < count - first; ++j) row[j] = from[i][j];
  }
}
#else
static inline void take(column* to, const double* matrix, const long long* of_lane, long long size, int rows, long long count,
                        long long first) {
  for (int i = 0; i < rows; ++i) {
    const double* row = matrix + i * count + first;
    if (!size) to[i] = row[0]; /* the same for all arms */
    else
      for (int j = 0; j < LANES; ++j) LANE(to[i], j) = row[of_lane[j] * size];
  }
}

static inline void put(const column* from, double* matrix, const long long* of_lane, long long size, int rows, long long count,
                       long long first) {
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < LANES; ++j) matrix[of_lane[j] * size + i * count + first] = LANE(from[i], j);
}
#endif

/* WIDTH rows of a matrix of `rows` rows, from entries that lie side by side. */
static inline void put_rows(const column* from, double* matrix, const long long* of_lane, long long size, int rows, int count,
                            int first) {
  for (int j = 0; j < LANES; ++j)
    for (int k = 0; k < WIDTH && first + k < rows; ++k) {
      double* row = matrix + of_lane[j] * size + (first + k) * count;
#pragma GCC unroll 8
      for (int i = 0; i < count; ++i) row[i] = LANE(PLACE(from[i], k), j);
    }
}

#ifndef STEPS_ONLY
#ifdef EVENTS
#define WITH_MODES , const engine_t *engine, int begins, long long *done

/* Columns of the state in which a tick begins, with what is held at rest. */
static void begin_columns(const calm_lanes_t* tick, const real* coefficients, column* dx) {
  column begun[NX];
  const column* const given[1] = {dx};
  if (!tick->held) return;
  begin_at_rest(coefficients, given, begun);
  memcpy(dx, begun, sizeof begun);
}

/* Columns of the state after a tick from those at its beginning and those that the step has reached. */
static void end_columns(const calm_lanes_t* tick, const real* coefficients, const column* dx, const column* dw,
                        column* moved) {
  column ended[NX];
  const column* const given[3] = {dx, moved, dw};
  if (!tick->closed) return;
  end_at_rest(coefficients, given, ended);
  memcpy(moved, ended, sizeof ended);
}

/* Coefficients of the projections at the beginning and at the end of a tick. */
static void find_rest(const real* u, const calm_lanes_t* tick, real* begin, real* end) {
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
#else
#define WITH_MODES
#endif
#if defined EVENTS && defined MOVING
#define IN_MODES(function, in_motion) (tick.held ? function : in_motion) /* simpler where nothing is held or touches */
#else
#define IN_MODES(function, in_motion) function
#endif

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
 *          or has been reached in motion, and for every arm the number of ticks before the first with an event.
 */
EXPORTED void carry_ticks(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
                          long long p_arm, const double* h, long long ticks, long long first, long long last,
                          const double* given, long long given_arm, const double* pushed, long long pushed_arm,
                          long long pushed_tick, int unit, long long count, double* after, double* columns,
                          long long columns_arm, long long columns_tick, signed char* met WITH_MODES) {
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
#ifdef EVENTS
    calm_lanes_t tick;
    foreseen_t begun[LANES];
    real rest[NBEGIN + 1], returning[NEND + 1], place[PLACES + 1];
#ifdef FORETELLS
    real inside[3 * NX];
#endif
    int calm[LANES], any = 1;
    for (int j = 0; j < LANES; ++j) {
      calm[j] = 1;
      done[of_lane[j]] = 0;
    }
#endif
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
#ifdef EVENTS
      begin_ticks(x, u, par, &length, begun, place);
#ifdef FORETELLS
      foresee_modes(engine, begun, &tick);
      arg[2] = tick.p;
      for (int i = 0; i < 3; ++i) res[2 + i] = inside + i * NX;
      IN_MODES(advance, moving_advance)(arg, res, iw, w, 0);
      find_places(next, place);
      write_steps(next, inside, place, begun);
#endif
      make_calm(begun, x, u, engine, begins && !k, calm, &tick);
      for (int j = any = 0; j < LANES; ++j) {
        any |= calm[j];
        if (calm[j]) done[of_lane[j]] = k + 1;
        else met[of_lane[j]] = 1;
      }
      if (!any) break;
      find_rest(u, &tick, rest, returning);
      arg[0] = tick.begin;
      arg[2] = tick.p;
      if (!tick.foreseen)
#endif
        IN_MODES(advance, moving_advance)(arg, res, iw, w, 0);
#ifdef EVENTS
      const int by_rows = unit && !k && !tick.held;
      memcpy(next, tick.after, sizeof next);
#else
      const int by_rows = unit && !k;
#endif
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
#ifdef EVENTS
        begin_columns(&tick, rest, dx);
        IN_MODES(carry, moving_carry)(derivatives, acting_columns, moved);
        end_columns(&tick, returning, dx, dw, moved);
#else
        carry(derivatives, acting_columns, moved);
#endif
        put(moved, reached, of_lane, columns_arm, NX, count, c);
      }
      for (int j = 0; j < LANES; ++j)
        for (int i = 0; i < NU; ++i) {
#ifdef STOPS
          const double q = LANE(x[i], j), v = LANE(x[NU + i], j), end = LANE(next[i], j), v_end = LANE(next[NU + i], j);
          const double near_by = 1e-6 * h[0] * (__builtin_fabs(v) + __builtin_fabs(v_end)) + 1e-9 * (1.0 + __builtin_fabs(q));
          met[of_lane[j]] |= meets_stop(q, v, end, v_end, h[0], near_by, i);
#endif
        }
      for (int i = 0; i < NX; ++i) x[i] = next[i];
    }
    for (int j = 0; j < LANES; ++j) {
      met[of_lane[j]] |= !within_reach(x, j);
      for (int i = 0; i < NX; ++i) after[of_lane[j] * NX + i] = LANE(x[i], j);
    }
  }
}
#endif

#ifdef STRETCH
/* One step of length h[0] from x under the effective command, with columns of (x, w, h): NX + NU + NT + 1 rows. */
EXPORTED void carry_step(const double* x, const double* u, const double* p, const double* h, const double* given,
                         long long count, double* after, double* columns) {
  real w[SZ_W], derivatives[NSTEP];
  column rows[NX + NU + NT + 1], moved[NX];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p, h};
  real* res[SZ_RES] = {after, derivatives};
  const long long alone[1] = {0};
  const column* parts[3] = {rows, rows + NX, rows + NX + NU + NT};
  advance(arg, res, iw, w, 0);
  for (long long c = 0; c < count; c += WIDTH) {
    take(rows, given, alone, 0, NX + NU + NT + 1, count, c);
    stretch(derivatives, parts, moved);
    put(moved, columns, alone, 0, NX, count, c);
  }
}
#endif
