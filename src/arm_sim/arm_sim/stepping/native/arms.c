/* SPDX-License-Identifier: Apache-2.0
 *
 * Arms in SIMD lanes: assignment of arms to lanes, and loading of their data.
 *
 * Required definitions: NU. With a controller in the tick also NR, the length of its references, which then replace torques.
 */

#ifdef NR
#define WITH_CONTROLLER
#define CONTROLLED , double* effort
#else
#define NR NU
#define CONTROLLED
#endif

/* In a scene with events also the engine of one arm. */
#ifdef EVENTS
#define WITH_ENGINE , const engine_t* engine
#else
#define WITH_ENGINE
#endif

/* Spare lanes of the last group repeat the last arm before `last`. */
static void choose_arms(long long arm, long long last, long long* of_lane) {
  for (int j = 0; j < LANES; ++j) of_lane[j] = arm + j < last ? arm + j : last - 1;
}

/* Load some numbers of each arm; those of arm i are at from + i * stride. */
static void read_arms(real* to, int count, const double* from, long long stride, const long long* of_lane) {
  for (int j = 0; j < LANES; ++j)
    for (int i = 0; i < count; ++i) LANE(to[i], j) = from[of_lane[j] * stride + i];
}
