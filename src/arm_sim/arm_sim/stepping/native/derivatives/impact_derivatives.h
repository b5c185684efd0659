/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivative of an impact: velocities after it by positions and velocities before it, and by tunable quantities.
 *
 * Which joints and contacts take part, rebound, stick or slide does not change; impulses follow from Newton's law in the
 * normal direction and Coulomb's law in the tangential ones, and their derivatives from the implicit function theorem.
 */

#pragma once
#include "numerics/least_squares.h"
#include "derivatives/sensitivities.h"

#define CONE_TOLERANCE 1e-9 /* relative distance to the friction cone below which an impulse is on its boundary */
#define IMPACT_COLUMNS (2 * NU + NT) /* of derivatives: by positions and velocities before it, and tunable quantities */

/* What an impact depends on besides the state before it.
 *
 * p:                   modes in the impact
 * joint_restitution:   of joints at their stops
 * contact_restitution: of contacts
 * carries:             whether a contact carries an impulse
 * sticks:              whether a contact sticks in the impact
 */
typedef struct {
  modes_t p;
  real *joint_restitution, *contact_restitution, *carries, *sticks;
} conditions_t;
#define CONDITIONS (P_LENGTH + NU + 3 * NC)

static conditions_t conditions_of(const scene_t* scene, real* numbers) {
  real* e = numbers + P_LENGTH;
  conditions_t conditions = {modes_of(scene, numbers), e, e + NU, e + NU + NC, e + NU + 2 * NC};
  clear(numbers, CONDITIONS);
  return conditions;
}

/* Velocities of joints and contacts after an impact; residuals of the laws, which are zero; and the derivatives of both by
 * what is given, IMPACT_COLUMNS columns, and by the impulses. */
typedef struct {
  real *v, *speed, *by_x, *by_impulse, *law, *law_by_impulse;
} impact_derivatives_t;
#define IMPACT_DERIVATIVES (NU + 3 * NC + (NU + 3 * NC) * (IMPACT_COLUMNS + 3 * NC))

static impact_derivatives_t impact_derivatives_of(const scene_t* scene, real* numbers) {
  impact_derivatives_t solution = {numbers, numbers + NU, numbers + NU + 3 * NC, 0, 0, 0};
  solution.by_impulse = solution.by_x + NU * IMPACT_COLUMNS;
  solution.law = solution.by_impulse + NU * 3 * NC;
  solution.law_by_impulse = solution.law + 3 * NC * IMPACT_COLUMNS;
  return solution;
}

static void evaluate_impact_laws(const scene_t* scene, const record_t* segment, const conditions_t* conditions,
                                 impact_derivatives_t* solution) {
  CALL(scene->impact_laws,
       (segment->before_impact, conditions->p.all, conditions->joint_restitution, conditions->contact_restitution,
        conditions->carries, conditions->sticks, segment->impulse),
       (solution->v, solution->speed, solution->by_x, solution->by_impulse, solution->law, solution->law_by_impulse));
}

/* Restitutions that give the velocities with which joints and contacts have left. */
static void find_restitutions(const scene_t* scene, const record_t* segment, conditions_t* conditions) {
  real place[3 * NC + 1], met[3 * NC + 1], size[NC + 1];
  copy(conditions->p.all, segment->p.all, P_LENGTH);
  copy(conditions->p.direction, segment->impact_direction, ND);
  for (int i = 0; i < NU; ++i)
    if (segment->departure_velocity[i] != 0.0)
      conditions->joint_restitution[i] = -segment->departure_velocity[i] / segment->before_impact[NU + i];
  if (NC) CALL(scene->contact_geometry, (segment->before_impact), (place, met, size));
  for (int k = 0; k < NC; ++k)
    if (segment->rebound[k] > 0.0) conditions->contact_restitution[k] = -segment->rebound[k] / met[3 * k];
}

/* Find which contacts carry an impulse, and which of them stick. */
static enum refusal find_impulse_carriers(const scene_t* scene, const tick_t* tick, const record_t* segment,
                                          const impact_derivatives_t* solution, conditions_t* conditions) {
  for (int k = 0; k < NC; ++k) {
    const real *r = segment->impulse + 3 * k, *s = solution->speed + 3 * k;
    const int carries = r[0] > 0.0, sticks = carries && hypot(r[1], r[2]) < (1.0 - CONE_TOLERANCE) * scene->friction[k] * r[0];
    if (carries && !sticks && hypot(s[1], s[2]) <= scene->slowest && scene->friction[k] > 0.0)
      return refuse(tick, IMPACT_ON_EDGE, k);
    conditions->carries[k] = carries;
    conditions->sticks[k] = sticks;
  }
  return NO_REFUSAL;
}

/* Take the derivatives of a state through the impact with which a segment begins. */
static enum refusal pass_impact(const scene_t* scene, const tick_t* tick, const record_t* segment, real (*slope)[NV]) {
  real moved[3 * NC * IMPACT_COLUMNS + 1], V[3 * NC * 3 * NC + 1], after[NU][NV];
  LOCAL(conditions_t, conditions, conditions_of, CONDITIONS);
  LOCAL(impact_derivatives_t, solution, impact_derivatives_of, IMPACT_DERIVATIVES);
  if (segment->rebound_fraction < 1.0) return REDUCED_REBOUND;
  find_restitutions(scene, segment, &conditions);
  if (NC) evaluate_impact_laws(scene, segment, &conditions, &solution);
  const enum refusal refused = find_impulse_carriers(scene, tick, segment, &solution, &conditions);
  if (refused) return refused;
  evaluate_impact_laws(scene, segment, &conditions, &solution);
  solve_least(3 * NC, 3 * NC, solution.law_by_impulse, V, IMPACT_COLUMNS, solution.law, moved);
  for (int j = 0; j < IMPACT_COLUMNS; ++j)
    for (int i = 0; i < NU; ++i)
      for (int k = 0; k < 3 * NC; ++k) solution.by_x[j * NU + i] -= solution.by_impulse[k * NU + i] * moved[j * 3 * NC + k];
  memset(after, 0, sizeof after);
  add_product(scene, NU, 2 * NU, solution.by_x, (const real(*)[NV])slope, after);
  for (int i = 0; i < NU; ++i)
    for (int j = 0; j < NT; ++j) after[i][NX + NU + j] += solution.by_x[(2 * NU + j) * NU + i];
  memcpy(slope + NU, after, sizeof after);
  return NO_REFUSAL;
}
