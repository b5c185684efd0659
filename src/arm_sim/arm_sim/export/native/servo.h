/* SPDX-License-Identifier: Apache-2.0
 *
 * What an exported library declares of its servos. `library` stands for the library's name.
 */
#pragma once
#include "library.h"

/* Commands of the drives in the next tick, with which the servos of the joints track positions, velocities or both, and to
 * which efforts are added. NaN, or NULL for all joints: not commanded; a joint of which only the effort is commanded gets it.
 */
void library_sim_servo(const library_sim* sim, const double* position, const double* velocity, const double* effort,
                       double* command);
