/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of the tick of an exported library. `library` stands for the library's name.
 *
 * Required definitions: sim.c, tangent_ticks.c, all of whose names begin with slope_, and the generated `kinked` (state, command)
 * -> 1 where the tick begins in a kink, else 0, and `effort_slopes` (state, command, state after the tick) -> derivatives of
 * the torques by the state after the tick, the state and the command, row by row.
 */

#include "sim.c"
#include "linearize.h"

#ifndef KINKED /* read alone, as editors do */
#define slope_NT 1
GENERATED(kinked);
GENERATED(effort_slopes);
void slope_carry_ticks(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
                       long long p_arm, const double* h, long long ticks, long long first, long long last, const double* given,
                       long long given_arm, const double* pushed, long long pushed_arm, long long pushed_tick, int unit,
                       long long count, double* after, double* columns, long long columns_arm, long long columns_tick,
                       signed char* met, const engine_t* engine, int begins, long long* done);
#endif

enum { VARIED = NX + NU + slope_NT };

/* Derivatives of the torques on the joints, from those of the state after the tick. */
static void find_effort_slopes(const struct library_sim* sim, const double* command, const double* after,
                               const double* of_state, double* of_effort) {
  double by_after[NU][NX], by_state[NU][NX], by_command[NU][NU];
  WORKSPACE;
  arg[0] = sim->x;
  arg[1] = command;
  arg[2] = after;
  res[0] = by_after[0];
  res[1] = by_state[0];
  res[2] = by_command[0];
  effort_slopes(arg, res, iw, w, 0);
  for (int i = 0; i < NU; ++i)
    for (int j = 0; j < VARIED; ++j) {
      double sum = j < NX ? by_state[i][j] : j < NX + NU ? by_command[i][j - NX] : 0.0;
      for (int k = 0; k < NX; ++k) sum += by_after[i][k] * of_state[k * VARIED + j];
      of_effort[i * VARIED + j] = sum;
    }
}

int library_sim_sensitivities(const library_sim* sim, const double* command, double* of_state, double* of_effort) {
  const double period = PERIOD;
  double unit[VARIED][VARIED], slopes[NX * VARIED], after[NX], kink;
  signed char marks[2] = {0}, *met = marks + 1; /* the one before: not halted */
  WORKSPACE;
  if (!all_finite(command, NU)) return LIBRARY_NOT_FINITE;
  arg[0] = sim->x;
  arg[1] = command;
  res[0] = &kink;
  kinked(arg, res, iw, w, 0);
  if (kink != 0.0) return LIBRARY_NO_DERIVATIVE;
  for (int i = 0; i < VARIED; ++i)
    for (int j = 0; j < VARIED; ++j) unit[i][j] = i == j;
#if EVENTS
  const engine_t engine = {predict, predicted_tick, event_free_tick};
  long long done;
  slope_carry_ticks(sim->x, command, 0, 0, sim->p, 0, &period, 1, 0, 1, unit[0], 0, unit[NX], 0, 0, 1, VARIED, after, slopes,
                    0, 0, met, &engine, 1, &done);
#else
  slope_carry_ticks(sim->x, command, 0, 0, sim->p, 0, &period, 1, 0, 1, unit[0], 0, unit[NX], 0, 0, 1, VARIED, after, slopes,
                    0, 0, met, NULL, 0, NULL);
#endif
  if (*met) return LIBRARY_NO_DERIVATIVE;
  for (int i = 0; i < NX * VARIED && of_state; ++i) of_state[i] = slopes[i];
  if (of_effort) find_effort_slopes(sim, command, after, slopes, of_effort);
  return LIBRARY_OK;
}

int library_sim_linearize(const library_sim* sim, const double* command, double* A, double* B) {
  double slopes[NX][VARIED];
  const int code = library_sim_sensitivities(sim, command, slopes[0], NULL);
  for (int i = 0; i < NX && code == LIBRARY_OK; ++i) {
    for (int j = 0; j < NX; ++j) A[i * NX + j] = slopes[i][j];
    for (int j = 0; j < NU; ++j) B[i * NU + j] = slopes[i][NX + j];
  }
  return code;
}
