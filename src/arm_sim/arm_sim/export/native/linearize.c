/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of the tick of an exported library. `library` stands for the library's name.
 *
 * Required definitions: sim.c, tick_derivative.c, all of whose names begin with slope_, and the generated `effort_slopes` (state,
 * command, state after the tick) -> derivatives of the torques by the state after the tick, the state and the command, row by
 * row.
 */

#include "sim.c"
#include "linearize.h"

#ifndef KINKED /* read alone, as editors do */
#include "derivatives/tangents.h"
#include "modes/prediction.h"
static const tangents_t slope_own_tangents;
int slope_differentiate_tick(const scene_t* scene, const tangents_t* tangents, const engine_t* engine, const double* x,
                             const double* r, const double* p, double h, double* after, double* slopes);
#endif

enum { VARIED = NX + NU + NT };

/* Derivatives of the torques on the joints, from those of the state after the tick. */
static void find_effort_slopes(const struct library_sim* sim, const double* command, const double* after,
                               const double* of_state, double* of_effort) {
  double by_after[NU][NX], by_state[NU][NX], by_command[NU][NU];
  CALL(effort_slopes, (sim->x, command, after), (by_after[0], by_state[0], by_command[0]));
  for (int i = 0; i < NU; ++i)
    for (int j = 0; j < VARIED; ++j) {
      double sum = j < NX ? by_state[i][j] : j < NX + NU ? by_command[i][j - NX] : 0.0;
      for (int k = 0; k < NX; ++k) sum += by_after[i][k] * of_state[k * VARIED + j];
      of_effort[i * VARIED + j] = sum;
    }
}

int library_sim_sensitivities(const library_sim* sim, const double* command, double* of_state, double* of_effort) {
  double slopes[NX * VARIED], after[NX];
  const engine_t* engine = NULL;
#if EVENTS
  static const engine_t own = {&own_scene, predict, predicted_tick, event_free_tick};
  engine = &own;
#endif
  if (!all_finite(command, NU)) return LIBRARY_NOT_FINITE;
  if (!slope_differentiate_tick(scene, &slope_own_tangents, engine, sim->x, command, sim->p, PERIOD, after, slopes))
    return LIBRARY_NO_DERIVATIVE;
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
