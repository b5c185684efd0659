/* SPDX-License-Identifier: Apache-2.0
 *
 * Propagation of tangents over one step.
 */

#include "lanes/lanes.h"
#include "derivatives/tangent_columns.h"

/* One step of length h[0] from x under the effective command, with columns of (x, w, h): NX + NU + NT + 1 rows. */
EXPORTED void carry_step(const double* x, const double* u, const double* p, const double* h, const double* given,
                         long long count, double* after, double* columns) {
  real w[SZ_W], derivatives[NSTEP];
  column rows[NX + NU + NT + 1], moved[NX];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {x, u, p, h};
  real* res[SZ_RES] = {after, derivatives};
  const long long alone[1] = {0};
  const column* parts[3] = {rows, rows + NX, rows + NX + NU + NT};
  advance(arg, res, iw, w, 0);
  for (long long c = 0; c < count; c += WIDTH) {
    take(rows, given, alone, 0, NX + NU + NT + 1, count, c);
    stretch(derivatives, parts, moved);
    put(moved, columns, alone, 0, NX, count, c);
  }
}
