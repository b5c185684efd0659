/* SPDX-License-Identifier: Apache-2.0
 *
 * The servos of an exported library. `library` stands for the library's name.
 *
 * Required definitions: sim.c, and the generated `servo` (commands of the drives, by state, reference and tunable
 * numbers).
 */

#include "sim.c"

/* A number of a command, 0 where there is none, and whether there is one. */
static double commanded(const double* values, int i, double* is_commanded) {
  *is_commanded = values && values[i] == values[i] ? 1.0 : 0.0;
  return *is_commanded > 0.0 ? values[i] : 0.0;
}

void library_sim_servo(const library_sim* sim, const double* position, const double* velocity, const double* effort,
                       double* command) {
  double reference[5][NU], follows, added;
  for (int i = 0; i < NU; ++i) {
    reference[2][i] = commanded(position, i, &reference[1][i]);
    reference[3][i] = commanded(velocity, i, &follows);
    reference[4][i] = commanded(effort, i, &added);
    reference[0][i] = reference[1][i] > 0.0 ? 1.0 : follows;
  }
  CALL(servo, (sim->x, reference[0], sim->p), (command));
}
