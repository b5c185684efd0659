/* SPDX-License-Identifier: Apache-2.0
 *
 * Impacts: velocities that jump where a contact point meets its plane. The same lines stand in Python in
 * contact_impact.py, with the reasons, for machines without a compiler; a test holds the two together.
 *
 * Before this file: contact_modes.c; HALVINGS.
 */

/* Impulse for rebound speeds; energy gained, or INFINITY if there is none. */
static double find_impulse(const inertia_t* inertia, const real* before, const double* rebound, double part,
                           const int* touching, double* impulse) {
  double c[MC], gain = 0.0;
  answer_t answers[NC];
  cones_t cones = {.W = inertia->W, .c = c};
  for (int i = 0; i < MC; ++i) c[i] = before[i];
  for (int k = 0; k < NC; ++k) {
    c[3 * k] -= part * rebound[k];
    cones.allowed[k] = touching[k];
  }
  if (!several(&cones, answers)) return INFINITY;
  for (int k = 0; k < NC; ++k) {
    if (answers[k].does == UNSOLVABLE) return INFINITY;
    for (int i = 0; i < 3; ++i) impulse[3 * k + i] = answers[k].force[i];
  }
  for (int i = 0; i < MC; ++i) {
    double change = 0.0;
    for (int j = 0; j < MC; ++j) change += AT(inertia->W, MC, i, j) * impulse[j];
    gain += impulse[i] * (before[i] + 0.5 * change);
  }
  return gain;
}

/* Change the velocities where a touching contact approaches: energy lost, or -1 if no impulse is found. */
static double impact(real* x, piece_t* piece, int rebounds) {
  where_t where;
  inertia_t inertia;
  double rebound[NC], impulse[MC], hop[NC], gain;
  int touching[NC], any = 0, any_rebound = 0;
  for (int k = 0; k < NC; ++k) MODE(piece, k)[0] = MODE(piece, k)[1] = 0.0;
  for (int i = 0; i < ND; ++i) DIRECTION(piece)[i] = 1.0;
  find_geometry(x, &where);
  find_touching(x, piece, &where, touching);
  for (int k = 0; k < NC; ++k) any |= touching[k] && where.speed[3 * k] < -calm_speed(x);
  if (!any) return 0.0;
  find_inertia(x, piece, &inertia);
  find_hops(x, piece, &where, hop);
  for (int k = 0; k < NC; ++k) {
    const int hits = touching[k] && where.speed[3 * k] < -calm_speed(x);
    rebound[k] = hits ? -restitution[k] * where.speed[3 * k] : 0.0;
    if (rebound[k] <= hop[k] || !rebounds) rebound[k] = 0.0;
    any_rebound |= rebound[k] > 0.0;
  }
  gain = find_impulse(&inertia, where.speed, rebound, 1.0, touching, impulse);
  if (gain > 0.0 && any_rebound) {
    double low = 0.0, high = 1.0;
    for (int k = 0; k < HALVINGS; ++k) {
      const double middle = 0.5 * (low + high);
      if (find_impulse(&inertia, where.speed, rebound, middle, touching, impulse) > 0.0) high = middle;
      else low = middle;
    }
    gain = find_impulse(&inertia, where.speed, rebound, low, touching, impulse);
  }
  if (gain == INFINITY) return -1.0;
  for (int i = 0; i < NU; ++i)
    for (int j = 0; j < MC; ++j) x[NU + i] += AT(inertia.B, NU, i, j) * impulse[j];
  return gain < 0.0 ? -gain : 0.0;
}
