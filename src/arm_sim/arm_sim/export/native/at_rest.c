/* SPDX-License-Identifier: Apache-2.0
 *
 * Accelerations of an arm some of whose joints are at rest: those that dry friction holds stay there.
 *
 * Required definitions: modes.h and what it needs, without contacts and stops; TUNABLE (nominal tunable numbers), and
 * the generated `acting_torques` (torques less those of friction with states).
 */

#include "events/modes.h"

#ifndef TUNABLE /* read alone, as editors do */
#define TUNABLE {0.0, 0.0, -9.81}
GENERATED(acting_torques);
#endif

static int is_resting(const double* v) {
  int any = 0;
  for (int i = 0; i < NU; ++i) any |= v[i] == 0.0 && may_stick(i);
  return any;
}

/* NaN if the laws of friction determine no motion. */
static void begin_motion(const double* q, const double* v, const double* tau, double* a) {
  __extension__ static const double nominal[NP] = TUNABLE;
  double x[NX], torque[NU], u[NU], slope[NX];
  modes_t p;
  WORKSPACE;
  for (int i = 0; i < NU; ++i) {
    x[i] = (double)q[i];
    x[NU + i] = (double)v[i];
    torque[i] = (double)tau[i];
  }
  arg[0] = x;
  arg[1] = x + NU;
  arg[2] = torque;
  res[0] = u;
  acting_torques(arg, res, iw, w, 0);
  set_zero(&p, sizeof p);
  for (int i = 0; i < NP; ++i) p.tunable[i] = nominal[i];
  const int found = find_modes(x, u, &p) == NONE;
  arg[0] = x;
  arg[1] = u;
  arg[2] = (const double*)&p;
  res[0] = slope;
  rhs(arg, res, iw, w, 0);
  for (int i = 0; i < NU; ++i) a[i] = found ? slope[NU + i] : NAN;
}
