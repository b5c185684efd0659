/* SPDX-License-Identifier: Apache-2.0
 *
 * Rebounds of joints from their stops and of contacts from their planes, and which of them are rounding: hops whose height is
 * that of the rounding of a gap.
 */

#pragma once
#include "modes/evaluations.h"

#define REBOUND_ROUNDING (64 * DBL_EPSILON) /* of a gap that opens, as a multiple of the lengths that add up to it */
#define LEAST_REBOUND 1e-9 /* speed of a rebound that is treated as rest */
#define CERTAIN_REBOUND 1e-4 /* speed above which a rebound is certainly not a hop within rounding */
enum impact_bits { HIT = 1, REBOUND = 2 }; /* of joints or contacts: whether one hits, and whether one rebounds */

/* Speed of a hop off a stop within the rounding of the joint's position, under an acceleration. */
static double rounding_rebound_of_joint(double q, double fall) {
  return LEAST_REBOUND + sqrt(2.0 * fabs(fall) * REBOUND_ROUNDING * (1.0 + fabs(q)));
}

/* Set joints at rest that an impact elsewhere moves off their stops by a hop within rounding; otherwise two alternating
 * impacts would never stop. */
static void rest_on_stops(const scene_t* scene, real* x, const segment_t* segment) {
  real slope[NX];
  int has_slope = 0;
  for (int i = 0; i < NU; ++i) {
    const double leaving = -at_stop(scene, x, i) * x[NU + i];
    if (!(leaving > 0.0 && leaving < CERTAIN_REBOUND)) continue;
    if (!has_slope) find_slope(scene, x, segment, slope);
    has_slope = 1;
    if (leaving <= rounding_rebound_of_joint(x[i], slope[NU + i])) x[NU + i] = 0.0;
  }
}

/* Speeds of hops within the rounding of the gap, or shorter than a step. */
static void find_rounding_rebounds(const scene_t* scene, const real* x, const segment_t* segment, const geometry_t* geometry,
                                   double* least_rebound) {
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  double fall = 0.0;
  find_mobility(scene, x, segment, &mobility);
  for (int k = 0; k < NC; ++k) fall = fmax(fall, fabs(mobility.free[3 * k]));
  for (int k = 0; k < NC; ++k)
    least_rebound[k] =
        LEAST_REBOUND + sqrt(2.0 * fall * REBOUND_ROUNDING * geometry->size[k]) + 0.5 * fall * segment->time_step;
}

/* Find velocities of joints after they hit their stops; returns enum impact_bits. None rebounds unless `allows_rebounds`. */
static int find_stop_rebounds(const scene_t* scene, const real* x, segment_t* segment, int allows_rebounds, double rounding,
                              double* departure_velocity) {
  int hits = 0, has_slope = 0;
  real slope[NX];
  for (int i = 0; i < NU; ++i) {
    const int side = at_stop(scene, x, i);
    const double speed = side * x[NU + i];
    departure_velocity[i] = 0.0;
    if (!(speed > rounding)) continue;
    hits |= HIT;
    const double rebound = allows_rebounds ? scene->stop_restitution[side > 0][i] * speed : 0.0;
    if (rebound <= LEAST_REBOUND) continue;
    if (!has_slope) find_slope(scene, x, segment, slope);
    has_slope = 1;
    if (rebound <= rounding_rebound_of_joint(x[i], slope[NU + i])) continue;
    departure_velocity[i] = -side * rebound;
    hits |= REBOUND;
  }
  return hits;
}

/* Find the speeds of touching contacts after they hit their planes, in `departure_speed`, which is zero at first; returns enum
 * impact_bits. None rebounds unless `allows_rebounds`. */
static int find_contact_rebounds(const scene_t* scene, const real* x, const segment_t* segment, int allows_rebounds,
                                 double rounding, const geometry_t* geometry, double* departure_speed) {
  double least_rebound[NC + 1];
  int hits = 0;
  for (int k = 0; k < NC; ++k) {
    const double speed = geometry->speed[3 * k], rebound = -scene->restitution[k] * speed;
    if (segment->contact[k].is_touching == 0.0 || !(speed < -rounding)) continue;
    if (!hits) find_rounding_rebounds(scene, x, segment, geometry, least_rebound);
    hits |= HIT;
    if (!allows_rebounds || rebound <= least_rebound[k]) continue;
    departure_speed[k] = rebound;
    hits |= REBOUND;
  }
  return hits;
}
