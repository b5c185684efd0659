/* SPDX-License-Identifier: Apache-2.0
 *
 * Whether joints and contacts at rest would come to rest again after the smallest push.
 *
 * Where static friction exceeds sliding friction, a joint may be held under a load that keeps it going once it moves: the
 * state after a tick then jumps with the velocity before it. Where friction vanishes, as in a lossy gear without load, a
 * joint is held by nothing.
 */

#pragma once
#include "numerics/least_squares.h"
#include "derivatives/sensitivities.h"

#define ROUNDING 1e-12        /* of a load relative to the sliding level, and of a velocity relative to the largest */
#define NO_DECELERATION 1e-12 /* [rad/s²] or [m/s²] below which it is rounding */

/* Project velocities onto those that bilateral constraints J v = 0 allow. */
static void project_onto_loops(const scene_t* scene, const real* x, const tick_t* tick, const record_t* segment, real* v) {
  real J[NU * (NM + 3 * NC) + 1], reaction[NU], capacity[2 * NU], drift[NM + 1], A[NM * NU + 1], V[NU * NU], residual[NM + 1],
      correction[NU];
  if (!(scene->constrained && ND)) return;
  CALL(scene->statics, (x, tick->u, segment->p.all), (J, reaction, capacity, drift));
  for (int k = 0; k < NM; ++k) {
    residual[k] = dot(J + k * NU, v, NU);
    for (int i = 0; i < NU; ++i) A[i * NM + k] = J[k * NU + i];
  }
  solve_least(NM, NU, A, V, 1, residual, correction);
  for (int i = 0; i < NU; ++i) v[i] -= correction[i];
}

/* Velocities after a push of a joint, without friction of those that are held. */
static void velocities_after_push(const scene_t* scene, int joint, const real* x, const tick_t* tick, const record_t* segment,
                                  real* v) {
  for (int i = 0; i < NU; ++i) v[i] = i == joint;
  if (any_closed(scene, segment->p.all)) {
    LOCAL_MODES(released, segment->p);
    real settling[NU * NU];
    for (int i = 0; i < ND; ++i)
      if (is_held(scene, segment, i) && scene->static_level[i] > 0.0) released.direction[i] = 1.0;
    CALL(scene->settled, (x, released.all), (settling));
    copy(v, settling + joint * NU, NU);
    return;
  }
  project_onto_loops(scene, x, tick, segment, v);
}

/* Whether a stop blocks a motion with velocities sign v. */
static int is_blocked(const scene_t* scene, const real* x, const real* v, double sign) {
  int any = 0;
  for (int i = 0; scene->rigid && i < NU; ++i)
    if (fabs(v[i]) > ROUNDING)
      any |= (x[i] <= scene->rigid_stop[0][i] && sign * v[i] < 0.0) || (x[i] >= scene->rigid_stop[1][i] && sign * v[i] > 0.0);
  return any;
}

/* Accelerations of a joint after a push in either direction, positive if it goes on; returns their number. A stop may leave
 * one direction; loops and contacts may leave none, or move other joints with it. */
static int accelerations_after_push(const scene_t* scene, int joint, const real* x, const tick_t* tick,
                                    const record_t* segment, double* acceleration) {
  real v[NU], slope[NX];
  int count = 0;
  velocities_after_push(scene, joint, x, tick, segment, v);
  const double largest = max_abs(v, NU);
  if (largest <= ROUNDING) return 0;
  for (int side = 0; side < 2; ++side) {
    const double sign = side ? -1.0 : 1.0;
    if (is_blocked(scene, x, v, sign)) continue;
    LOCAL_MODES(pushed, segment->p);
    for (int i = 0; i < ND; ++i)
      if (is_held(scene, segment, i) && scene->static_level[i] > 0.0 && fabs(v[i]) > ROUNDING * largest)
        pushed.direction[i] = sign * v[i] > 0.0 ? 1.0 : -1.0;
    CALL(scene->rhs, (x, tick->u, pushed.all), (slope));
    acceleration[count++] = sign * dot(slope + NU, v, NU) / dot(v, v, NU);
  }
  return count;
}

/* A contact whose static coefficient exceeds that of sliding, and whose load lies between them. */
static enum refusal check_slipping(const scene_t* scene, const real* x, const tick_t* tick, const record_t* segment) {
  real load[NU], force[3 * NC + 1], rate[3 * NC + 1], grip[NC + 1];
  if (!NC) return NO_REFUSAL;
  CALL(scene->loads, (x, tick->u, segment->p.all), (load, force, rate, grip, 0, 0));
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t* mode = segment->p.contact + k;
    const real* r = force + 3 * k;
    if (mode->closed == 0.0 || mode->sticks == 0.0 || !(scene->static_friction[k] > scene->friction[k])) continue;
    if (scene->friction[k] > 0.0 && hypot(r[1], r[2]) >= (1.0 - ROUNDING) * scene->friction[k] * r[0])
      return refuse(tick, CONTACT_WOULD_GO_ON, k);
  }
  return NO_REFUSAL;
}

/* Refuse a motion from rest that has no derivative. `state_varied`: whether the state itself is varied; else what rests has
 * come to rest before, and rests in all motions nearby. */
static enum refusal check_rest(const scene_t* scene, const tick_t* tick, const record_t* segment, int state_varied) {
  const real* x = segment->motion_begin;
  real doubt[2];
  CALL(scene->doubts, (x, tick->u, segment->p.all), (doubt));
  if (doubt[state_varied] == 0.0) return NO_REFUSAL;
  for (int joint = 0; joint < ND; ++joint) {
    if (!is_held(scene, segment, joint) || !(scene->static_level[joint] > 0.0)) continue;
    double acceleration[2], sum = 0.0;
    int goes_on = 0;
    const int count = accelerations_after_push(scene, joint, x, tick, segment, acceleration);
    for (int k = 0; k < count; ++k) sum += fabs(acceleration[k]);
    for (int k = 0; k < count; ++k) goes_on |= acceleration[k] >= -ROUNDING * sum;
    if (count && sum <= NO_DECELERATION) return refuse(tick, UNLOADED_GEAR, joint);
    if (state_varied && goes_on) return refuse(tick, JOINT_WOULD_GO_ON, joint);
  }
  return state_varied ? check_slipping(scene, x, tick, segment) : NO_REFUSAL;
}
