/* SPDX-License-Identifier: Apache-2.0
 *
 * Boundaries between the modes of a segment: where a switch changes the motion, and derivatives beside one that stays.
 */

#pragma once
#include "derivatives/guard_derivatives.h"

#define SLOPE_ROUNDING 1e-9 /* relative difference of slopes that is none */

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
static long long find_boundaries(const scene_t* scene, const real* x, const tick_t* tick, const record_t* segment) {
  LOCAL(guards_t, at, guards_of, GUARDS);
  long long zero[1 + NG], count = 0;
  find_guards(scene, x, tick, segment, &at);
  find_zero(scene, &at, x, tick, segment, zero);
  for (; count < zero[0] && zero[count + 1] < NG - NK; ++count) tick->subjects[count + 1] = zero[count + 1];
  for (int k = 0; k < NK; ++k)
    if (is_near(&at, NG - NK + k, tick->length) && at.active[NG - NK + k] > 0.0
        && is_boundary(scene, k, &at, x, tick, segment))
      tick->subjects[++count] = NG - NK + k;
  tick->subjects[0] = count;
  return count;
}

/* Lead the derivatives of a state beside a switch that stays, such as that of a current at its limit, back to the switch. */
static void lead_back_to_switches(const scene_t* scene, const tick_t* tick, const record_t* segment, real (*slope)[NV]) {
  LOCAL(guards_t, at, guards_of, GUARDS);
  find_guards(scene, segment->motion_begin, tick, segment, &at);
  for (int k = 0; k < NK; ++k) {
    const int guard = NG - NK + k, holds = segment->p.switches[k] != 0.0;
    real side[2][NX], by[2][NX * (NX + NU)], by_x[NX], change[NV], guard_rate = 0.0;
    if (!is_near(&at, guard, tick->length) || !(at.active[guard] > 0.0) || !is_steady(&at, guard, tick->length)) continue;
    find_sides(scene, k, segment->motion_begin, tick, segment, side, by);
    if (!are_different(side[0], side[1], NX)) continue;
    find_change(scene, guard, segment->motion_begin, tick, segment, (const real(*)[NV])slope, by_x, change);
    for (int i = 0; i < NX; ++i) guard_rate += by_x[i] * (side[!holds][i] - side[holds][i]);
    if (!((holds ? guard_rate : -guard_rate) > 0.0)) continue;
    for (int i = 0; i < NX; ++i)
      for (int j = 0; j < NV; ++j) slope[i][j] -= (side[!holds][i] - side[holds][i]) / guard_rate * change[j];
  }
}
