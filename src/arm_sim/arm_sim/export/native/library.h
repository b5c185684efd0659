/* SPDX-License-Identifier: Apache-2.0
 *
 * What an exported library declares of its tick. `library` stands for the library's name.
 */
#pragma once
#include <stddef.h>

/* A simulated arm. It lives in memory of the caller, library_sim_size() bytes, aligned to 64, and may be copied as it is: a
 * copy continues to the same bits. */
typedef struct library_sim library_sim;

/* Codes of errors. */
enum {
  LIBRARY_OK,
  LIBRARY_NOT_FINITE,
  LIBRARY_OPEN,
  LIBRARY_BEYOND_STOP,
  LIBRARY_INSIDE_PLANE,
  LIBRARY_UNKNOWN,
  LIBRARY_NOT_ALLOWED,
  LIBRARY_DIVERGED,
  LIBRARY_UNDETERMINED,
  LIBRARY_NO_DERIVATIVE
};

/* What a code means. */
const char* library_error_text(int code);

size_t library_sim_size(void);

/* The number of joints, and the length of a tick in [s], for programs that load the library at run time. */
int library_sim_joints(void);
double library_sim_period(void);

/* Positions between which joints can be: their rigid stops, infinite where there are none. */
void library_sim_range(double* lower, double* upper);

/* Begin at positions and velocities; NULL: those of the scene. Drives and bristles begin without load. Returns 0 or a code;
 * after a code the simulation cannot be stepped. */
int library_sim_init(library_sim* sim, const double* q, const double* v);

/* Advance by a tick under a command, which is clipped at the limits. Returns 0, or a code, and then the state is kept. */
int library_sim_step(library_sim* sim, const double* command);

/* The state, and the torques of the last tick on the joints; arrays that are NULL are left out. */
void library_sim_state(const library_sim* sim, double* q, double* v, double* effort);

/* Set a number that the scene declares tunable, from the next tick on. Returns 0, or a code, and then it is kept. */
int library_sim_set(library_sim* sim, const char* parameter, double value);
