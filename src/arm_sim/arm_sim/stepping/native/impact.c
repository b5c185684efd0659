/* SPDX-License-Identifier: Apache-2.0
 *
 * Impacts: velocities that jump where a contact point meets its plane.
 *
 * Newton's restitution for the normal, Coulomb's law for the tangential impulse and the speed after (Moreau, "Unilateral
 * contact and dry friction in finite freedom dynamics", CISM 302, 1988). Both together may add energy (Kane, Levinson,
 * Dynamics, Theory and Applications, 1985); then the rebound is the highest that does not. A rebound for which no impulse
 * is found counts as one that does.
 *
 * Before this file: modes.c.
 */

#define REBOUND_HALVINGS 60 /* that find the highest rebound that adds no energy */

/* Impulse for rebound speeds; energy gained, or INFINITY if there is none. */
static double find_impulse(const inertia_t* inertia, const real* before, const double* rebound, double part,
                           const contact_t* contact, double* impulse) {
  double c[MC], gain = 0.0;
  answer_t answers[NC];
  cones_t cones = {.W = inertia->W, .c = c, .friction = friction, .holding = friction};
  for (int i = 0; i < MC; ++i) c[i] = before[i];
  for (int k = 0; k < NC; ++k) {
    c[3 * k] -= part * rebound[k];
    cones.allowed[k] = contact[k].touching;
  }
  if (!several(&cones, answers)) return INFINITY;
  for (int k = 0; k < NC; ++k) {
    if (answers[k].state == UNSOLVABLE) return INFINITY;
    for (int i = 0; i < 3; ++i) impulse[3 * k + i] = answers[k].force[i];
  }
  for (int i = 0; i < MC; ++i) {
    double change = 0.0;
    for (int j = 0; j < MC; ++j) change += AT(inertia->W, MC, i, j) * impulse[j];
    gain += impulse[i] * (before[i] + 0.5 * change);
  }
  return gain;
}

/* Change the velocities where a touching contact approaches: energy lost, or -1 if no impulse is found.
 *
 * A contact that opens just then takes part too, for the blow may push it back.
 * A rebound that would not rise above the rounding of the gap is none, and without `rebounds` there are none at all: the
 * contact closes. `geometry` is that of x, before and after.
 */
static double impact(real* x, segment_t* segment, int rebounds, geometry_t* geometry) {
  inertia_t inertia;
  double rebound[NC], impulse[MC], hop[NC], gain;
  int any = 0, any_rebound = 0;
  for (int k = 0; k < NC; ++k) segment->p.contact[k].closed = segment->p.contact[k].sticks = 0.0;
  for (int i = 0; i < ND; ++i) segment->p.direction[i] = 1.0;
  find_geometry(x, geometry);
  find_closed_gaps(segment, geometry);
  const double calm = speed_rounding(x);
  for (int k = 0; k < NC; ++k) any |= segment->contact[k].touching && geometry->speed[3 * k] < -calm;
  if (!any) return 0.0;
  find_inertia(x, segment, &inertia);
  find_hops(x, segment, geometry, hop);
  for (int k = 0; k < NC; ++k) {
    const int hits = segment->contact[k].touching && geometry->speed[3 * k] < -calm;
    rebound[k] = hits ? -restitution[k] * geometry->speed[3 * k] : 0.0;
    if (rebound[k] <= hop[k] || !rebounds) rebound[k] = 0.0;
    any_rebound |= rebound[k] > 0.0;
  }
  gain = find_impulse(&inertia, geometry->speed, rebound, 1.0, segment->contact, impulse);
  if (gain > 0.0 && any_rebound) {
    double low = 0.0, high = 1.0;
    for (int k = 0; k < REBOUND_HALVINGS; ++k) {
      const double middle = 0.5 * (low + high);
      if (find_impulse(&inertia, geometry->speed, rebound, middle, segment->contact, impulse) > 0.0) high = middle;
      else low = middle;
    }
    gain = find_impulse(&inertia, geometry->speed, rebound, low, segment->contact, impulse);
  }
  if (gain == INFINITY) return -1.0;
  for (int i = 0; i < NU; ++i)
    for (int j = 0; j < MC; ++j) x[NU + i] += AT(inertia.B, NU, i, j) * impulse[j];
  find_geometry(x, geometry);
  return gain < 0.0 ? -gain : 0.0;
}
