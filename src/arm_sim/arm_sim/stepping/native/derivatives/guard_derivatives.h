/* SPDX-License-Identifier: Apache-2.0
 *
 * Guards at the ends of a segment: which are zero, and how the instant changes at which one is.
 */

#pragma once
#include "derivatives/sensitivities.h"

#define TIME_ROUNDING 1e-9   /* fraction of a tick within which a guard that reaches zero is zero */
#define TERM_ROUNDING 1e-12  /* fraction of its terms below which a guard is zero */
#define SLOPE_ROUNDING 1e-9  /* relative difference of slopes that is none */
#define GRAZING_RATE 1e-4    /* rate of a guard that grazes zero, relative to that at the beginning */
#define DELAY_ROUNDING 1e-9  /* relative difference of the derivatives of an event's time that is none */

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

/* Active guards that are zero; their number. A switch that stays where it switches does not switch. */
static int find_zero(const scene_t* scene, const guards_t* at, const real* x, const tick_t* tick, const record_t* segment) {
  int count = 0;
  for (int i = 0; i < NG; ++i) {
    const int joint = i - 2 * NC;
    if (!is_near(at, i, tick->length) || !(at->active[i] > 0.0)) continue;
    if (i >= NG - NK && is_steady(at, i, tick->length)) continue;
    if (joint >= 0 && joint < NU && is_carried(scene, at, x, segment, joint)) continue;
    tick->subjects[++count] = i;
  }
  tick->subjects[0] = count;
  return count;
}

/* Whether two lists of numbers differ by more than rounding. */
static int are_different(const real* a, const real* b, int count) {
  double most = 0.0, size = 0.0;
  for (int i = 0; i < count; ++i) {
    most = fmax(most, fabs(a[i] - b[i]));
    size = fmax(size, fabs(a[i]) + fabs(b[i]));
  }
  return most > SLOPE_ROUNDING * size;
}

/* x' and its derivatives on both sides of a switch. */
static void find_sides(const scene_t* scene, int number, const real* x, const tick_t* tick, const record_t* segment,
                       real slope[2][NX], real by[2][NX * (NX + NU)]) {
  for (int holds = 0; holds < 2; ++holds) {
    LOCAL_MODES(p, segment->p);
    p.switches[number] = holds;
    CALL(scene->motion, (x, tick->u, p.all), (slope[holds], by[holds]));
  }
}

/* Whether a switch that is near is a boundary: not one that does not change the slopes, and none at which both sides lead
 * back, such as that of a current at its limit. One that stays at zero is. */
static int is_boundary(const scene_t* scene, int number, const guards_t* at, const real* x, const tick_t* tick,
                       const record_t* segment) {
  real slope[2][NX], by[2][NX * (NX + NU)];
  find_sides(scene, number, x, tick, segment, slope, by);
  const int jumps = are_different(slope[0], slope[1], NX), bends = are_different(by[0], by[1], NX * (NX + NU));
  return jumps ? !is_steady(at, NG - NK + number, tick->length) : bends;
}

/* Guards that are zero, and on whose sides motions change differently; their number. */
static int find_boundaries(const scene_t* scene, const real* x, const tick_t* tick, const record_t* segment) {
  LOCAL(guards_t, at, guards_of, GUARDS);
  int count = 0;
  find_guards(scene, x, tick, segment, &at);
  const int zero = find_zero(scene, &at, x, tick, segment);
  while (count < zero && tick->subjects[count + 1] < NG - NK) ++count;
  for (int k = 0; k < NK; ++k)
    if (is_near(&at, NG - NK + k, tick->length) && at.active[NG - NK + k] > 0.0
        && is_boundary(scene, k, &at, x, tick, segment))
      tick->subjects[++count] = NG - NK + k;
  tick->subjects[0] = count;
  return count;
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

/* Lead the derivatives of a state beside a switch that stays, such as that of a current at its limit, back to the switch. */
static void lead_back_to_switches(const scene_t* scene, const tick_t* tick, const record_t* segment, real (*slope)[NV]) {
  LOCAL(guards_t, at, guards_of, GUARDS);
  find_guards(scene, segment->motion_begin, tick, segment, &at);
  for (int k = 0; k < NK; ++k) {
    const int guard = NG - NK + k, holds = segment->p.switches[k] != 0.0;
    real side[2][NX], by[2][NX * (NX + NU)], by_x[NX], change[NV], along = 0.0;
    if (!is_near(&at, guard, tick->length) || !(at.active[guard] > 0.0) || !is_steady(&at, guard, tick->length)) continue;
    find_sides(scene, k, segment->motion_begin, tick, segment, side, by);
    if (!are_different(side[0], side[1], NX)) continue;
    find_change(scene, guard, segment->motion_begin, tick, segment, (const real(*)[NV])slope, by_x, change);
    for (int i = 0; i < NX; ++i) along += by_x[i] * (side[!holds][i] - side[holds][i]);
    if (!((holds ? along : -along) > 0.0)) continue;
    for (int i = 0; i < NX; ++i)
      for (int j = 0; j < NV; ++j) slope[i][j] -= (side[!holds][i] - side[holds][i]) / along * change[j];
  }
}

/* Derivative of the length of a segment that a guard ends, from that of its end at constant length, and by the length. */
static void follow_guard(const scene_t* scene, int guard, const tick_t* tick, const record_t* segment, const real (*slope)[NV],
                         const real* speed, real* delay) {
  real by_x[NX], change[NV], along = 0.0;
  find_change(scene, guard, segment->motion_end, tick, segment, slope, by_x, change);
  for (int i = 0; i < NX; ++i) along += by_x[i] * speed[i];
  for (int j = 0; j < NV; ++j) delay[j] = -change[j] / along;
}

/* Find the derivative of the length of a segment that an event ends, whichever it is. Joints of a loop come to rest together:
 * that is one event. */
static enum refusal find_delay(const scene_t* scene, const tick_t* tick, const record_t* segment, const real (*slope)[NV],
                               const real* speed, real* delay) {
  LOCAL(guards_t, begin, guards_of, GUARDS);
  LOCAL(guards_t, end, guards_of, GUARDS);
  double apart = 0.0, largest = 0.0;
  tick->subjects[0] = 0;
  /* A switch that does not change the motion, such as that of a current that leaves its limit, is no event. */
  if (segment->length <= TIME_ROUNDING * tick->length)
    return find_boundaries(scene, segment->motion_begin, tick, segment) ? SAME_INSTANT : NO_REFUSAL;
  find_guards(scene, segment->motion_begin, tick, segment, &begin);
  find_guards(scene, segment->motion_end, tick, segment, &end);
  const int zero = find_zero(scene, &end, segment->motion_end, tick, segment);
  if (!zero) return GRAZES;
  for (int k = 1; k <= zero; ++k) {
    const long long i = tick->subjects[k];
    if (!(fabs(end.rate[i]) > GRAZING_RATE * fabs(begin.rate[i]))) return GRAZES;
  }
  real delays[NG][NV];
  for (int k = 0; k < zero; ++k) follow_guard(scene, (int)tick->subjects[k + 1], tick, segment, slope, speed, delays[k]);
  for (int j = 0; j < NV; ++j) {
    double low = delays[0][j], high = low;
    for (int k = 0; k < zero; ++k) {
      low = fmin(low, delays[k][j]);
      high = fmax(high, delays[k][j]);
      largest = fmax(largest, fabs(delays[k][j]));
    }
    apart = fmax(apart, high - low);
    delay[j] = delays[0][j];
  }
  return apart > DELAY_ROUNDING * largest ? COINCIDE : NO_REFUSAL;
}
