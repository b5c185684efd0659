/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivative of an impact: velocities after it by positions and velocities before it, and by tunable quantities.
 *
 * Which joints and contacts take part, rebound, stick or slide does not change; impulses follow from Newton's law in the normal
 * direction and Coulomb's law in the tangential ones, and their derivatives from the implicit function theorem.
 */

#pragma once
#include "numerics/least_squares.h"
#include "derivatives/sensitivities.h"

#define ON_EDGE 1e-9           /* relative distance to the friction cone below which an impulse is on its boundary */
#define GIVEN_JUMP (2 * NU + NT) /* columns of its derivatives */

/* What an impact depends on besides the state before it. */
__extension__ typedef struct {
  modes_t p;
  real e[NU], f[NC], carries[NC], sticks[NC];
} jump_t;

__extension__ typedef struct {
  real v[NU], speed[3 * NC], by_x[NU * GIVEN_JUMP], by_impulse[NU * 3 * NC];
  real law[3 * NC * GIVEN_JUMP], law_by_impulse[3 * NC * 3 * NC];
} jump_derivatives_t;

static void solve_impact(const record_t* segment, const jump_t* jump, jump_derivatives_t* found) {
  CALL(impact_laws, (segment->before, numbers(&jump->p), jump->e, jump->f, jump->carries, jump->sticks, segment->impulse),
       (found->v, found->speed, found->by_x, found->by_impulse, found->law, found->law_by_impulse));
}

/* Restitutions that give the velocities with which joints and contacts have left. */
static void find_restitutions(const record_t* segment, jump_t* jump) {
  __extension__ real place[3 * NC], met[3 * NC], size[NC];
  memset(jump, 0, sizeof *jump);
  jump->p = segment->p;
  memcpy(jump->p.direction, segment->meets, sizeof segment->meets);
  for (int i = 0; i < NU; ++i)
    if (segment->leaves[i] != 0.0) jump->e[i] = -segment->leaves[i] / segment->before[NU + i];
  if (NC) CALL(contact_geometry, (segment->before), (place, met, size));
  for (int k = 0; k < NC; ++k)
    if (segment->rebound[k] > 0.0) jump->f[k] = -segment->rebound[k] / met[3 * k];
}

/* Find which contacts carry an impulse, and which of them stick. */
static enum refusal find_parts(const tick_t* tick, const record_t* segment, const jump_derivatives_t* found, jump_t* jump) {
  for (int k = 0; k < NC; ++k) {
    const real *r = segment->impulse + 3 * k, *s = found->speed + 3 * k;
    const int carries = r[0] > 0.0, sticks = carries && hypot(r[1], r[2]) < (1.0 - ON_EDGE) * friction[k] * r[0];
    if (carries && !sticks && hypot(s[1], s[2]) <= SLOWEST && friction[k] > 0.0) return refuse(tick, IMPACT_ON_EDGE, k);
    jump->carries[k] = carries;
    jump->sticks[k] = sticks;
  }
  return NO_REFUSAL;
}

/* Take the derivatives of a state through the impact with which a segment begins. */
static enum refusal pass_impact(const tick_t* tick, const record_t* segment, real (*slope)[NV]) {
  __extension__ real moved[3 * NC * GIVEN_JUMP], V[3 * NC * 3 * NC];
  real after[NU][NV];
  jump_t jump;
  jump_derivatives_t found;
  if (segment->part < 1.0) return REDUCED_REBOUND;
  find_restitutions(segment, &jump);
  if (NC) solve_impact(segment, &jump, &found);
  const enum refusal refused = find_parts(tick, segment, &found, &jump);
  if (refused) return refused;
  solve_impact(segment, &jump, &found);
  solve_least(3 * NC, 3 * NC, found.law_by_impulse, V, GIVEN_JUMP, found.law, moved);
  for (int j = 0; j < GIVEN_JUMP; ++j)
    for (int i = 0; i < NU; ++i)
      for (int k = 0; k < 3 * NC; ++k) found.by_x[j * NU + i] -= found.by_impulse[k * NU + i] * moved[j * 3 * NC + k];
  memset(after, 0, sizeof after);
  add_product(NU, 2 * NU, found.by_x, (const real(*)[NV])slope, after);
  for (int i = 0; i < NU; ++i)
    for (int j = 0; j < NT; ++j) after[i][NX + NU + j] += found.by_x[(2 * NU + j) * NU + i];
  memcpy(slope + NU, after, sizeof after);
  return NO_REFUSAL;
}
