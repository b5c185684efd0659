/* SPDX-License-Identifier: Apache-2.0
 *
 * Arms in SIMD lanes: assignment of arms to lanes, loading of their data, and what is asked of each. C where `real` is a
 * double, C++ where it is a vector of them.
 */

#pragma once
#include "motion/stops.h"

#ifdef __cplusplus
#define EXPORTED extern "C" __attribute__((visibility("default")))
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

/* Whether the caller wants nothing more: the mark before those of the arms. */
#define HALTED (((volatile const signed char*)met)[-1])

/* Spare lanes of the last group repeat the last arm before `last`. */
static void choose_arms(long long arm, long long last, long long* of_lane) {
  for (int j = 0; j < LANES; ++j) of_lane[j] = arm + j < last ? arm + j : last - 1;
}

/* Load some numbers of each arm; those of arm i are at from + i * stride. */
static void read_arms(real* to, int count, const double* from, long long stride, const long long* of_lane) {
  for (int j = 0; j < LANES; ++j)
    for (int i = 0; i < count; ++i) LANE(to[i], j) = from[of_lane[j] * stride + i];
}

/* Store some numbers of each arm; those of lane j go to to + j * stride. */
static inline void write_arms(double* to, long long stride, const real* from, int count) {
  for (int j = 0; j < LANES; ++j)
    for (int i = 0; i < count; ++i) to[j * stride + i] = LANE(from[i], j);
}

/* Whether every number of a lane's state is finite and not too large. */
static inline int within_reach(const real* x, int lane) {
  int reached = 1;
  (void)lane; /* alone */
  for (int i = 0; i < NX; ++i) reached &= __builtin_fabs(LANE(x[i], lane)) <= LARGEST;
  return reached;
}

/* Whether the arm in a lane may meet a stop in a motion of that length from x to `next`. */
static inline int meets_any_stop(const real* x, const real* next, double length, int lane) {
  int met = 0;
  (void)lane; /* alone */
  for (int i = 0; STOPS && i < NU; ++i)
    met |= meets_stop(LANE(x[i], lane), LANE(x[NU + i], lane), LANE(next[i], lane), LANE(next[NU + i], lane), length, 0.0, i);
  return met;
}
