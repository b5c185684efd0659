/* SPDX-License-Identifier: Apache-2.0
 *
 * What an exported library declares of the derivatives of its tick. `library` stands for the library's name.
 */
#pragma once
#include "library.h"

/* Derivatives of the state after a tick from here under a command: A by the state, STATES x STATES, B by the command, STATES x
 * JOINTS, row by row; the state is positions, velocities and internal states. Returns 0, or a code, and then A and B are not
 * set. The simulation is not advanced. */
int library_sim_linearize(const library_sim* sim, const double* command, double* A, double* B);

/* The same derivatives side by side, by state, command, and the numbers that may be set, in their order: of the state after
 * the tick, and of the torques on the joints in it; NULL: not wanted. */
int library_sim_sensitivities(const library_sim* sim, const double* command, double* of_state, double* of_effort);
