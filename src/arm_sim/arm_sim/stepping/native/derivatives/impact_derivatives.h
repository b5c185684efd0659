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

#define ON_EDGE 1e-9           /* relative distance to the friction cone below which an impulse is on its boundary */
#define GIVEN_JUMP (2 * NU + NT) /* columns of its derivatives */

/* What an impact depends on besides the state before it. */
typedef struct {
  modes_t p;
  real *e, *f, *carries, *sticks;
} jump_t;
#define JUMP (P_LENGTH + NU + 3 * NC)

static jump_t jump_of(const scene_t* scene, real* numbers) {
  real* e = numbers + P_LENGTH;
  jump_t jump = {modes_of(scene, numbers), e, e + NU, e + NU + NC, e + NU + 2 * NC};
  clear(numbers, JUMP);
  return jump;
}

/* Velocities of joints and contacts after an impact, and derivatives by what is given (GIVEN_JUMP columns) and by the impulses:
 * of the velocities, and of the laws, which are zero. */
typedef struct {
  real *v, *speed, *by_x, *by_impulse, *law, *law_by_impulse;
} jump_derivatives_t;
#define JUMP_DERIVATIVES (NU + 3 * NC + (NU + 3 * NC) * (GIVEN_JUMP + 3 * NC))

static jump_derivatives_t jump_derivatives_of(const scene_t* scene, real* numbers) {
  jump_derivatives_t solution = {numbers, numbers + NU, numbers + NU + 3 * NC, 0, 0, 0};
  solution.by_impulse = solution.by_x + NU * GIVEN_JUMP;
  solution.law = solution.by_impulse + NU * 3 * NC;
  solution.law_by_impulse = solution.law + 3 * NC * GIVEN_JUMP;
  return solution;
}

static void solve_impact(const scene_t* scene, const record_t* segment, const jump_t* jump, jump_derivatives_t* solution) {
  CALL(scene->impact_laws, (segment->before, jump->p.all, jump->e, jump->f, jump->carries, jump->sticks, segment->impulse),
       (solution->v, solution->speed, solution->by_x, solution->by_impulse, solution->law, solution->law_by_impulse));
}

/* Restitutions that give the velocities with which joints and contacts have left. */
static void find_restitutions(const scene_t* scene, const record_t* segment, jump_t* jump) {
  real place[3 * NC + 1], met[3 * NC + 1], size[NC + 1];
  copy(jump->p.all, segment->p.all, P_LENGTH);
  copy(jump->p.direction, segment->impact_direction, ND);
  for (int i = 0; i < NU; ++i)
    if (segment->leaves[i] != 0.0) jump->e[i] = -segment->leaves[i] / segment->before[NU + i];
  if (NC) CALL(scene->contact_geometry, (segment->before), (place, met, size));
  for (int k = 0; k < NC; ++k)
    if (segment->rebound[k] > 0.0) jump->f[k] = -segment->rebound[k] / met[3 * k];
}

/* Find which contacts carry an impulse, and which of them stick. */
static enum refusal find_parts(const scene_t* scene, const tick_t* tick, const record_t* segment,
                               const jump_derivatives_t* solution, jump_t* jump) {
  for (int k = 0; k < NC; ++k) {
    const real *r = segment->impulse + 3 * k, *s = solution->speed + 3 * k;
    const int carries = r[0] > 0.0, sticks = carries && hypot(r[1], r[2]) < (1.0 - ON_EDGE) * scene->friction[k] * r[0];
    if (carries && !sticks && hypot(s[1], s[2]) <= scene->slowest && scene->friction[k] > 0.0)
      return refuse(tick, IMPACT_ON_EDGE, k);
    jump->carries[k] = carries;
    jump->sticks[k] = sticks;
  }
  return NO_REFUSAL;
}

/* Take the derivatives of a state through the impact with which a segment begins. */
static enum refusal pass_impact(const scene_t* scene, const tick_t* tick, const record_t* segment, real (*slope)[NV]) {
  real moved[3 * NC * GIVEN_JUMP + 1], V[3 * NC * 3 * NC + 1], after[NU][NV];
  LOCAL(jump_t, jump, jump_of, JUMP);
  LOCAL(jump_derivatives_t, solution, jump_derivatives_of, JUMP_DERIVATIVES);
  if (segment->rebound_fraction < 1.0) return REDUCED_REBOUND;
  find_restitutions(scene, segment, &jump);
  if (NC) solve_impact(scene, segment, &jump, &solution);
  const enum refusal refused = find_parts(scene, tick, segment, &solution, &jump);
  if (refused) return refused;
  solve_impact(scene, segment, &jump, &solution);
  solve_least(3 * NC, 3 * NC, solution.law_by_impulse, V, GIVEN_JUMP, solution.law, moved);
  for (int j = 0; j < GIVEN_JUMP; ++j)
    for (int i = 0; i < NU; ++i)
      for (int k = 0; k < 3 * NC; ++k) solution.by_x[j * NU + i] -= solution.by_impulse[k * NU + i] * moved[j * 3 * NC + k];
  memset(after, 0, sizeof after);
  add_product(scene, NU, 2 * NU, solution.by_x, (const real(*)[NV])slope, after);
  for (int i = 0; i < NU; ++i)
    for (int j = 0; j < NT; ++j) after[i][NX + NU + j] += solution.by_x[(2 * NU + j) * NU + i];
  memcpy(slope + NU, after, sizeof after);
  return NO_REFUSAL;
}
