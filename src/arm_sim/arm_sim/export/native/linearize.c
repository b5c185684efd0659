/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of the tick of an exported library. `library` stands for the library's name.
 *
 * Required definitions: sim.c, tangents.c, all of whose names begin with slope_, and the generated `kinked` (state, command)
 * -> 1 where the tick begins in a kink, else 0.
 */

#include "sim.c"
#include "linearize.h"

#ifndef KINKED /* read alone, as editors do */
GENERATED(kinked);
void slope_carry_ticks(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
                       long long p_arm, const double* h, long long ticks, long long first, long long last,
                       const double* given, long long given_arm, const double* pushed, long long pushed_arm,
                       long long pushed_tick, int unit, long long count, double* after, double* columns,
                       long long columns_arm, long long columns_tick, signed char* met, const engine_t* engine, int begins,
                       long long* done);
#endif

int library_sim_linearize(const library_sim* sim, const double* command, double* A, double* B) {
  enum { COUNT = NX + NU };
  const double period = PERIOD;
  double unit[COUNT][COUNT], slopes[NX][COUNT], after[NX], kink;
  signed char met = 0;
  WORKSPACE;
  if (!all_finite(command, NU)) return LIBRARY_NOT_FINITE;
  arg[0] = sim->x;
  arg[1] = command;
  res[0] = &kink;
  kinked(arg, res, iw, w, 0);
  if (kink != 0.0) return LIBRARY_NO_DERIVATIVE;
  for (int i = 0; i < COUNT; ++i)
    for (int j = 0; j < COUNT; ++j) unit[i][j] = i == j;
#ifdef EVENTS
  const engine_t engine = {foresee, tick_as_foreseen, calm_tick};
  long long done;
  slope_carry_ticks(sim->x, command, 0, 0, sim->p, 0, &period, 1, 0, 1, unit[0], 0, unit[NX], 0, 0, 1, COUNT, after, slopes[0],
                    0, 0, &met, &engine, 1, &done);
#else
  slope_carry_ticks(sim->x, command, 0, 0, sim->p, 0, &period, 1, 0, 1, unit[0], 0, unit[NX], 0, 0, 1, COUNT, after, slopes[0],
                    0, 0, &met);
#endif
  if (met) return LIBRARY_NO_DERIVATIVE;
  for (int i = 0; i < NX; ++i) {
    for (int j = 0; j < NX; ++j) A[i * NX + j] = slopes[i][j];
    for (int j = 0; j < NU; ++j) B[i * NU + j] = slopes[i][NX + j];
  }
  return LIBRARY_OK;
}
