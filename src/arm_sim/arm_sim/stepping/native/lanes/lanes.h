/* SPDX-License-Identifier: Apache-2.0
 *
 * Arms in SIMD lanes: assignment of arms to lanes, loading of their data, and what is asked of each. C where `real` is a
 * double, C++ where it is a vector of them.
 */

#pragma once
#include "modes/prediction.h"
#include "motion/stops.h"

#include <stdint.h>

#define STOP_MARGIN 1e-9  /* distance to a stop that is near, relative to the position or 1 */
#define SPEED_MARGIN 1e-6 /* distance to a stop that is near, relative to the way at the speeds of a tick; see STOP_MARGIN */

/* Arms and their ticks. Python: ArmTable.
 *
 * x0:         states at the beginning, NX for each arm
 * tau:        commands: tick k of arm i at tau + i * tau_arm + k * tau_tick
 * p:          tunable numbers: arm i at p + i * p_arm
 * h:          length of a tick
 * ticks:      number of ticks
 * unfinished: of each arm, 0 at first: whether it is to be advanced alone
 * halted:     becomes nonzero if the results are of no use any more
 * engine:     in a scene with events, that of one arm
 */
typedef struct {
  const double *x0, *tau, *p;
  long long tau_arm, tau_tick, p_arm;
  double h;
  long long ticks;
  int8_t* unfinished;
  const int8_t* halted;
  const engine_t* engine;
} arms_t;

/* Whether another thread has halted this work; to be read anew each time. */
static int is_halted(const arms_t* arms) { return *(volatile const int8_t*)arms->halted; }

/* Lanes that have an arm in the group that begins with one. */
static inline int lanes_used(long long arm, long long last) { return last - arm < LANES ? (int)(last - arm) : LANES; }

/* Load some numbers of each arm; those of arm i are at from + i * stride. */
static void read_arms(real* to, int count, const double* from, long long stride, const long long* of_lane) {
  for (int j = 0; j < LANES; ++j)
    for (int i = 0; i < count; ++i) LANE(to[i], j) = from[of_lane[j] * stride + i];
}

/* Choose the arms of a group and load their tunable numbers. Spare lanes of the last group repeat the arm before `last`. */
static void begin_lanes(const scene_t* scene, const arms_t* arms, long long arm, long long last, long long* of_lane, real* p) {
  for (int j = 0; j < LANES; ++j) of_lane[j] = arm + j < last ? arm + j : last - 1;
  read_arms(p, NP, arms->p, arms->p_arm, of_lane);
}

/* Load what acts in a tick. */
static void read_commands(const arms_t* arms, long long tick, int count, const long long* of_lane, real* to) {
  read_arms(to, count, arms->tau + tick * arms->tau_tick, arms->tau_arm, of_lane);
}

/* Store some numbers of each arm in a lane that is used; those of lane j go to to + j * stride. */
static inline void write_arms(double* to, long long stride, const real* from, int count, int used) {
  for (int j = 0; j < used; ++j)
    for (int i = 0; i < count; ++i) to[j * stride + i] = LANE(from[i], j);
}

/* Whether every number of a lane's state is finite and not too large. */
static inline int is_lane_within_reach(const scene_t* scene, const real* x, int lane) {
  int reached = 1;
  (void)lane; /* alone */
  for (int i = 0; i < NX; ++i) reached &= __builtin_fabs(LANE(x[i], lane)) <= scene->largest;
  return reached;
}

/* Whether the arm in a lane may meet a stop in a motion of that length from x to `next`, or come near one, `with_margin`. */
static inline int meets_any_stop(const scene_t* scene, const real* x, const real* next, double length, int with_margin,
                                 int lane) {
  int met = 0;
  (void)lane; /* alone */
  for (int i = 0; scene->has_stops_without_events && i < NU; ++i) {
    const double q = LANE(x[i], lane), v = LANE(x[NU + i], lane), end = LANE(next[i], lane), v_end = LANE(next[NU + i], lane);
    const double speeds = __builtin_fabs(v) + __builtin_fabs(v_end);
    const double margin = SPEED_MARGIN * length * speeds + STOP_MARGIN * (1.0 + __builtin_fabs(q));
    met |= meets_stop(scene, q, v, end, v_end, length, with_margin ? margin : 0.0, i);
  }
  return met;
}

/* Mark arms that may meet a stop in a tick from x to `next`, or come near one, `with_margin`. */
static inline void mark_stops(const scene_t* scene, const arms_t* arms, const long long* of_lane, const real* x,
                              const real* next, int with_margin) {
  for (int j = 0; j < LANES; ++j) arms->unfinished[of_lane[j]] |= meets_any_stop(scene, x, next, arms->h, with_margin, j);
}
