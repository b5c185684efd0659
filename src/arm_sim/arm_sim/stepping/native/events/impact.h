/* SPDX-License-Identifier: Apache-2.0
 *
 * Impacts: velocities that jump where a contact point meets its plane, or a joint its stop.
 *
 * Newton's restitution for the normal direction, Coulomb's law for the tangential impulse and the velocity after (Moreau,
 * "Unilateral contact and dry friction in finite freedom dynamics", CISM 302, 1988). Both together may add energy (Kane,
 * Levinson, Dynamics, Theory and Applications, 1985); then the rebound is the largest that does not. A rebound for which no
 * impulse is found is treated as adding energy. The stops that take part in an impact are found by pivoting, like modes: a
 * stop that would have to pull does not take part, one that its joint would pass does.
 */

#pragma once
#include "modes/modes.h"

#define REBOUND_HALVINGS 60 /* bisections to find the largest rebound that adds no energy */
#define IMPACT_PIVOTS (3 * NU + (1 << (NU < 12 ? NU : 12))) /* changes of the stops that take part in an impact */
#define IMPACT_WORST_FIRST (3 * NU) /* changes before which the largest violation is chosen, then the first */
#define VELOCITY_ERROR 1e-6   /* relative error of the velocities after an impulse: a jammed contact cannot rebound */
#define PULL_ROUNDING 1e-12 /* tolerated pulling impulse of a stop, relative to the largest */

/* An impact: desired velocities after it, and its result. */
typedef struct {
  double* rebound;            /* desired: speeds of contacts away from their planes */
  double* departure_velocity; /* desired: of joints that hit their stops; 0 for others, which remain at their stops */
  double* impulse;            /* result: impulses of contacts */
  real* after;                /* result: velocities of all joints */
  int has_contact;            /* whether a contact takes part */
  double energy_gain;         /* result: INFINITY if no impulse was found */
} impact_t;
#define IMPACT (NC + MC + 2 * NU)

static impact_t impact_of(const scene_t* scene, double* numbers) {
  impact_t impact = {numbers, numbers + NC, numbers + NC + NU, numbers + NC + NU + MC, 0, 0.0};
  clear(numbers, IMPACT);
  return impact;
}

/* Impulses of contacts that meet with the velocities `before`, with a fraction of the full rebound, under the mobility that
 * the stops leave: the energy they add. */
static double find_impulse(const scene_t* scene, const mobility_t* mobility, const real* before, double fraction,
                           const contact_t* contact, impact_t* impact) {
  double c[MC + 1], gain = 0.0;
  contact_solution_t answers[NC + 1];
  LOCAL(cones_t, cones, cones_of, CONES);
  cones.W = mobility->W;
  cones.c = c;
  cones.friction = cones.static_friction = scene->friction;
  for (int i = 0; i < MC; ++i) c[i] = before[i];
  for (int k = 0; k < NC; ++k) {
    c[3 * k] -= fraction * impact->rebound[k];
    cones.is_touching[k] = contact[k].is_touching;
    cones.was_sliding[k] = 0;
  }
  if (!solve_contacts(scene, &cones, answers)) return INFINITY;
  for (int k = 0; k < NC; ++k) {
    if (answers[k].state == UNSOLVABLE) return INFINITY;
    for (int i = 0; i < 3; ++i) impact->impulse[3 * k + i] = answers[k].force[i];
  }
  const double largest = max_abs(c, MC);
  for (int i = 0; i < MC; ++i) {
    double change = 0.0;
    for (int j = 0; j < MC; ++j) change += AT(mobility->W, MC, i, j) * impact->impulse[j];
    gain += impact->impulse[i] * (before[i] + 0.5 * change);
    const enum contact_state state = answers[i / 3].state;
    const int is_reached = state == STICKS || (state == SLIDES && i % 3 == 0);
    if (is_reached && fabs(c[i] + change) > VELOCITY_ERROR * largest) return INFINITY;
  }
  return gain;
}

/* Velocities after an impact in which the joints whose stops take part, of direction 0, change by `change`, and the impulses
 * of these stops. */
static void apply_impact_map(const scene_t* scene, const real* x, const segment_t* segment, const real* change,
                             const double* impulse, real* after, real* stop_impulse) {
  CALL(scene->impact_map, (x, segment->p.all, change, impulse), (after, stop_impulse));
  segment->memory->work += scene->impact_cost;
}

/* The joint at a stop with the largest, or just the first, violation in the impact; -1 if there is none. */
static int find_infeasible_stop(const scene_t* scene, const real* x, const segment_t* segment, const real* after,
                                const real* stop_impulse, int first) {
  const double fastest = 1.0 + max_abs(x + NU, NU), hardest = max_abs(stop_impulse, NU);
  double most = 0.0;
  int worst = -1;
  for (int i = 0; i < NU; ++i) {
    const int side = at_stop(scene, x, i);
    if (!side) continue;
    const double excess = segment->p.direction[i] == 0.0 ? side * stop_impulse[i] / fmax(hardest, 1e-300) - PULL_ROUNDING
                                                         : side * after[i] / fastest - SPEED_ROUNDING;
    if (!(excess > most)) continue;
    most = excess;
    worst = i;
    if (first) return worst;
  }
  return worst;
}

/* The result of an impact with a fraction of the full rebound where no joint has a rigid stop. */
static void solve_impact_of_contacts(const scene_t* scene, const real* x, segment_t* segment, double fraction,
                                     impact_t* impact) {
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  find_mobility(scene, x, segment, &mobility);
  find_geometry(scene, x, segment, &geometry);
  impact->energy_gain = find_impulse(scene, &mobility, geometry.speed, fraction, segment->contact, impact);
  if (impact->energy_gain == INFINITY) return;
  for (int i = 0; i < NU; ++i) {
    impact->after[i] = x[NU + i];
    for (int j = 0; j < MC; ++j) impact->after[i] += AT(mobility.B, NU, i, j) * impact->impulse[j];
  }
}

/* Find which contacts and stops take part in an impact with a fraction of the full rebound, and its result. The direction of a
 * joint is 0 while its stop takes part, else 1. */
static void solve_impact(const scene_t* scene, const real* x, segment_t* segment, double fraction, impact_t* impact) {
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  real met[2 * NU], change[NU], stop_impulse[NU];
  if (!scene->rigid) {
    solve_impact_of_contacts(scene, x, segment, fraction, impact);
    return;
  }
  impact->energy_gain = INFINITY;
  copy(met, x, NU);
  for (int i = 0; i < NU; ++i) segment->p.direction[i] = at_stop(scene, x, i) * x[NU + i] > 0.0 ? 0.0 : 1.0;
  for (int k = 0; k < IMPACT_PIVOTS; ++k) {
    for (int i = 0; i < NU; ++i)
      change[i] = segment->p.direction[i] == 0.0 ? fraction * impact->departure_velocity[i] - x[NU + i] : 0.0;
    for (int i = 0; i < MC; ++i) impact->impulse[i] = 0.0;
    apply_impact_map(scene, x, segment, change, impact->impulse, impact->after, stop_impulse);
    if (impact->has_contact) {
      copy(met + NU, impact->after, NU);
      find_mobility(scene, x, segment, &mobility);
      find_geometry(scene, met, segment, &geometry);
      if (find_impulse(scene, &mobility, geometry.speed, fraction, segment->contact, impact) == INFINITY) return;
      apply_impact_map(scene, x, segment, change, impact->impulse, impact->after, stop_impulse);
    }
    const int wrong = find_infeasible_stop(scene, x, segment, impact->after, stop_impulse, k >= IMPACT_WORST_FIRST);
    if (wrong >= 0) {
      segment->p.direction[wrong] = 1.0 - segment->p.direction[wrong];
      continue;
    }
    find_geometry(scene, x, segment, &geometry);
    impact->energy_gain = 0.0;
    for (int i = 0; i < NU; ++i) {
      if (segment->p.direction[i] == 0.0) impact->after[i] = fraction * impact->departure_velocity[i];
      impact->energy_gain += 0.5 * stop_impulse[i] * (x[NU + i] + impact->after[i]);
    }
    copy(met + NU, impact->after, NU);
    for (int i = 0; i < MC; ++i) impact->energy_gain += 0.5 * impact->impulse[i] * geometry.speed[i];
    find_geometry(scene, met, segment, &geometry);
    for (int i = 0; i < MC; ++i) impact->energy_gain += 0.5 * impact->impulse[i] * geometry.speed[i];
    return;
  }
}

/* Joints set at rest on their stops after a blow take their loops with them. */
static void stop_linked_joints(const scene_t* scene, real* x, segment_t* segment, impact_t* impact) {
  real change[NU], stop_impulse[NU], after[NU];
  int any = 0;
  if (!(scene->constrained && scene->rigid)) return;
  for (int i = 0; i < NU; ++i) {
    change[i] = x[NU + i] - impact->after[i];
    any |= change[i] != 0.0;
    segment->p.direction[i] = at_stop(scene, x, i) && x[NU + i] == 0.0 ? 0.0 : 1.0;
  }
  if (!any) return;
  for (int i = 0; i < MC; ++i) impact->impulse[i] = 0.0;
  for (int i = 0; i < NU; ++i) x[NU + i] = impact->after[i];
  apply_impact_map(scene, x, segment, change, impact->impulse, after, stop_impulse);
  for (int i = 0; i < NU; ++i) x[NU + i] = segment->p.direction[i] == 0.0 ? 0.0 : after[i];
}

/* Record an impact with a fraction of the full rebound in a traced tick. */
static void record_impact(const scene_t* scene, record_t* record, const segment_t* segment, const impact_t* impact,
                          double fraction) {
  if (!record) return;
  record->has_impact = 1;
  record->rebound_fraction = fraction;
  copy(record->impact_direction, segment->p.direction, ND);
  for (int i = 0; i < NU; ++i) record->departure_velocity[i] = impact->departure_velocity[i];
  for (int k = 0; k < NC; ++k) record->rebound[k] = impact->rebound[k];
  for (int i = 0; i < MC; ++i) record->impulse[i] = impact->impulse[i];
}

/* Change the velocities where a touching contact approaches, or a joint hits its stop: energy lost, or -1 if no impulse
 * is found.
 *
 * A contact that is just opening takes part too, since the impact may push it back, and so does a joint at rest at its stop.
 * A rebound within the rounding of the gap is ignored, and unless `allows_rebounds` all are: the contact closes. `geometry` is
 * that of x, before and after.
 */
static double apply_impact(const scene_t* scene, real* x, segment_t* segment, int allows_rebounds, geometry_t* geometry) {
  for (int k = 0; k < NC; ++k) segment->p.contact[k].closed = segment->p.contact[k].sticks = 0.0;
  for (int i = 0; i < ND; ++i) segment->p.direction[i] = 1.0;
  if (!NC && !scene->rigid) return 0.0;
  LOCAL(impact_t, impact, impact_of, IMPACT);
  double fraction = 1.0;
  find_geometry(scene, x, segment, geometry);
  find_closed_gaps(scene, segment, geometry);
  const double rounding = speed_rounding(scene, x);
  int hits = find_stop_rebounds(scene, x, segment, allows_rebounds, rounding, impact.departure_velocity);
  hits |= find_contact_rebounds(scene, x, segment, allows_rebounds, rounding, geometry, impact.rebound);
  if (!hits) return 0.0;
  for (int k = 0; k < NC; ++k) impact.has_contact |= segment->contact[k].is_touching != 0.0;
  solve_impact(scene, x, segment, 1.0, &impact);
  if (impact.energy_gain > 0.0 && hits & REBOUND) {
    double low = 0.0, high = 1.0;
    for (int k = 0; k < REBOUND_HALVINGS; ++k) {
      const double middle = 0.5 * (low + high);
      solve_impact(scene, x, segment, middle, &impact);
      if (impact.energy_gain > 0.0) high = middle;
      else low = middle;
    }
    solve_impact(scene, x, segment, low, &impact);
    fraction = low;
  }
  if (impact.energy_gain == INFINITY) return -1.0;
  record_impact(scene, segment->record, segment, &impact, fraction);
  for (int i = 0; i < NU; ++i) x[NU + i] = impact.after[i];
  rest_on_stops(scene, x, segment);
  stop_linked_joints(scene, x, segment, &impact);
  find_geometry(scene, x, segment, geometry);
  return impact.energy_gain < 0.0 ? -impact.energy_gain : 0.0;
}
