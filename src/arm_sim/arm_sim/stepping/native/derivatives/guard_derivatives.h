/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards at the ends of a segment: which are zero, and their derivatives.
 */

#pragma once
#include "derivatives/sensitivities.h"

#define TIME_ROUNDING 1e-9   /* fraction of a tick within which a guard that reaches zero is zero */
#define TERM_ROUNDING 1e-12  /* fraction of its terms below which a guard is zero */

/* All guards at a state: their values, the magnitudes of their terms, their rates, 1 where they are active in the modes; and
 * the accelerations of the joints. */
typedef struct {
  real *value, *size, *rate, *active, *a;
} guards_t;
#define GUARDS (4 * NG + NU)

static guards_t guards_of(const scene_t* scene, real* numbers) {
  guards_t guards = {numbers, numbers + NG, numbers + 2 * NG, numbers + 3 * NG, numbers + 4 * NG};
  return guards;
}

static void find_guards(const scene_t* scene, const real* x, const tick_t* tick, const record_t* segment, guards_t* at) {
  CALL(scene->guards, (x, tick->u, segment->p.all, segment->stick_limit), (at->value, at->size, at->rate, at->active, at->a));
}

/* Whether a guard is zero, or passes zero within an instant. */
static int is_near(const guards_t* at, int i, double h) {
  return fabs(at->value[i]) <= TIME_ROUNDING * h * fabs(at->rate[i]) + TERM_ROUNDING * at->size[i];
}

/* Whether a guard hardly changes in a tick. */
static int is_steady(const guards_t* at, int i, double h) { return !(fabs(at->rate[i]) * h > TERM_ROUNDING * at->size[i]); }

/* Whether a loop holds a joint in a sliding mode at rest because other joints stick. */
static int is_carried(const scene_t* scene, const guards_t* at, const real* x, const record_t* segment, int joint) {
  return scene->constrained && ND && segment->p.direction[joint] != 0.0
         && fmax(fabs(x[NU + joint]), fabs(at->a[joint])) <= scene->slowest;
}

/* Active guards that are zero, `zero`, behind their number. A switch that stays where it switches does not switch. */
static void find_zero(const scene_t* scene, const guards_t* at, const real* x, const tick_t* tick, const record_t* segment,
                      long long* zero) {
  zero[0] = 0;
  for (int i = 0; i < NG; ++i) {
    const int joint = i - 2 * NC;
    if (!is_near(at, i, tick->length) || !(at->active[i] > 0.0)) continue;
    if (i >= NG - NK && is_steady(at, i, tick->length)) continue;
    if (joint >= 0 && joint < NU && is_carried(scene, at, x, segment, joint)) continue;
    zero[++zero[0]] = i;
  }
}

/* Derivatives of a guard, `change`, from those of the state, `slope`. */
static void find_change(const scene_t* scene, int guard, const real* x, const tick_t* tick, const record_t* segment,
                        const real (*slope)[NV], real* by_x, real* change) {
  real weight[NG], by_w[NW + 1];
  for (int i = 0; i < NG; ++i) weight[i] = i == guard;
  CALL(scene->guard_gradient, (x, tick->u, segment->p.all, segment->stick_limit, weight), (by_x, by_w));
  for (int j = 0; j < NV; ++j) {
    change[j] = j < NX ? 0.0 : by_w[j - NX];
    for (int i = 0; i < NX; ++i) change[j] += by_x[i] * slope[i][j];
  }
}
