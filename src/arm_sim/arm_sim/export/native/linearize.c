/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of the tick of an exported library. `library` stands for the library's name.
 *
 * Required definitions: sim.c, tick_derivative.c, all of whose names begin with slope_, and the generated `effort_slopes`
 * (state, command, state after the tick, its derivatives row by row) -> derivatives of the torques on the joints, row by row.
 */

#include "sim.c"
#include "linearize.h"

enum { VARIED = NX + NU + NT };
#if EVENTS
static const engine_t own_engine = {&own_scene, predict, predicted_tick, event_free_tick};
#define ENGINE (&own_engine)
#else /* without the type of engines */
#define ENGINE NULL
#endif

int library_sim_sensitivities(const library_sim* sim, const double* command, double* of_state, double* of_effort) {
  double slopes[NX * VARIED], after[NX];
  if (!all_finite(command, NU)) return LIBRARY_NOT_FINITE;
  if (!slope_differentiate_tick(scene, &slope_own_tangents, ENGINE, sim->x, command, sim->p, LIBRARY_PERIOD, after, slopes))
    return LIBRARY_NO_DERIVATIVE;
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
