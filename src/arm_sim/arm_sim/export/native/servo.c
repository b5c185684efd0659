/* SPDX-License-Identifier: Apache-2.0
 *
 * The servos of an exported library. `library` stands for the library's name.
 *
 * Required definitions: sim.c, and the generated `servo` (commands of the drives, by state, reference and tunable
 * numbers).
 */

#include "sim.c"

/* Rows of the reference, as those of Setpoints in Python. */
enum { TRACKS_VELOCITY, TRACKS_POSITION, POSITION, VELOCITY, EFFORT, ROWS };

/* A number of a command, 0 where there is none, and whether there is one. */
static double commanded(const double* values, int i, double* is_commanded) {
  *is_commanded = values && values[i] == values[i] ? 1.0 : 0.0;
  return *is_commanded > 0.0 ? values[i] : 0.0;
}

void library_sim_servo(const library_sim* sim, const double* position, const double* velocity, const double* effort,
                       double* command) {
  double reference[ROWS][NU], has_velocity, has_effort;
  for (int i = 0; i < NU; ++i) {
    reference[POSITION][i] = commanded(position, i, &reference[TRACKS_POSITION][i]);
    reference[VELOCITY][i] = commanded(velocity, i, &has_velocity);
    reference[EFFORT][i] = commanded(effort, i, &has_effort);
    reference[TRACKS_VELOCITY][i] = reference[TRACKS_POSITION][i] > 0.0 ? 1.0 : has_velocity;
  }
  CALL(servo, (sim->x, reference[0], sim->p), (command));
}
