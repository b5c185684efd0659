/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of the tick of an exported library. `library` stands for the library's name.
 *
 * Required definitions: sim.c, tangent_ticks.c, all of whose names begin with slope_, and the generated `kinked` (state, command)
 * -> 1 where the tick begins in a kink, else 0, and `effort_slopes` (state, command, state after the tick, its derivatives row
 * by row) -> derivatives of the torques on the joints.
 */

#include "sim.c"
#include "linearize.h"

enum { VARIED = NX + NU + NT };

int library_sim_sensitivities(const library_sim* sim, const double* command, double* of_state, double* of_effort) {
  double unit[VARIED][VARIED], slopes[NX * VARIED], after[NX], kink;
  int8_t marks[2] = {0}, *met = marks + 1; /* the one before: not halted */
  if (!all_finite(command, NU)) return LIBRARY_NOT_FINITE;
  CALL(kinked, (sim->x, command), (&kink));
  if (kink != 0.0) return LIBRARY_NO_DERIVATIVE;
  for (int i = 0; i < VARIED; ++i)
    for (int j = 0; j < VARIED; ++j) unit[i][j] = i == j;
  long long done;
  slope_arms_t arms = {sim->x, command, sim->p, 0, 0, 0, PERIOD, 1, met, NULL};
  const slope_columns_t columns = {unit[0], unit[NX], slopes, 0, 0, 0, 0, 0, VARIED, 1, EVENTS, &done, after};
#if EVENTS
  const engine_t engine = {scene, predict, predicted_tick, event_free_tick};
  arms.engine = &engine;
#endif
  slope_carry_ticks(scene, &slope_own_tangents, &arms, 0, 1, &columns);
  if (*met) return LIBRARY_NO_DERIVATIVE;
  for (int i = 0; i < NX * VARIED && of_state; ++i) of_state[i] = slopes[i];
  if (of_effort) CALL(effort_slopes, (sim->x, command, after, slopes), (of_effort));
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
