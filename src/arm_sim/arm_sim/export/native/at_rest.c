/* SPDX-License-Identifier: Apache-2.0
 *
 * Accelerations of an arm some of whose joints are at rest: those that dry friction holds stay there.
 *
 * Required definitions: modes.h and what it needs, without contacts and stops; TUNABLE (nominal tunable numbers), and
 * the generated `acting_torques` (torques less those of friction with states).
 */

#include "modes/modes.h"

/* Whether a joint is at rest that dry friction may hold. */
static int is_resting(const double* v) {
  const scene_t* scene = &own_scene;
  int any = 0;
  for (int i = 0; i < NU; ++i) any |= v[i] == 0.0 && may_stick(scene, i);
  return any;
}

/* Accelerations under drive torques; NaN if the laws of friction determine none. */
static void accelerations_at_rest(const double* q, const double* v, const double* tau, double* a) {
  static const double nominal[NP + 1] = TUNABLE;
  const scene_t* scene = &own_scene;
  double x[NX], u[NU], slope[NX], p[P_LENGTH];
  copy(x, q, NU);
  copy(x + NU, v, NU);
  CALL(acting_torques, (q, v, tau), (u));
  clear(p, P_LENGTH);
  copy(p, nominal, NP);
  const int is_determined = find_modes(scene, x, u, p) == NONE;
  CALL(scene->rhs, (x, u, p), (slope));
  for (int i = 0; i < NU; ++i) a[i] = is_determined ? slope[NU + i] : NAN;
}
