/* SPDX-License-Identifier: Apache-2.0
 *
 * Propagation of tangents over one step.
 */

#include "lanes/lanes.h"
#include "derivatives/tangent_columns.h"

/* One step of length h[0] from x under the effective command, with columns of (x, w, h): NX + NU + NT + 1 rows. */
EXPORTED void propagate_step(const scene_t* scene, const tangents_t* tangents, const double* x, const double* u,
                             const double* p, const double* h, const double* tangents_before, long long count, double* after,
                             double* columns) {
  real derivatives[NSTEP];
  column rows[NX + NU + NT + 1], moved[NX];
  const long long alone[1] = {0};
  const layout_t layout = {0, count, alone};
  const column* parts[3] = {rows, rows + NX, rows + NX + NU + NT};
  CALL(scene->advance, (x, u, p, h), (after, derivatives, 0, 0, 0));
  for (long long c = 0; c < count; c += WIDTH) {
    read_columns(rows, tangents_before, &layout, NX + NU + NT + 1, c);
    tangents->propagate(derivatives, parts, moved);
    write_columns(moved, columns, &layout, NX, c);
  }
}
