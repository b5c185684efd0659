/* SPDX-License-Identifier: Apache-2.0
 *
 * Evaluation of a trajectory. Python reads this header, see trajectory_library.py.
 */
#pragma once
#include <stdint.h>

#include "entry.h"

/* Evaluate a trajectory of quintic segments, at rest before and after them.
 *
 * n            number of joints
 * knots        times of the segments + 1 knots in [s] from 0
 * polynomials  of every segment, coefficients of s⁰ to s⁵, s from 0 to 1 in the segment: power after power, each of
 *              positions, velocities and accelerations of n joints
 * ends         positions before and after the motion
 * torques      at every knot, linear between them and constant before and after; NULL: none, zero
 * t            time in [s] from the start
 * motion       receives positions, velocities, accelerations and torques */
QUICK void trajectory_sample(int64_t n, int64_t segments, const double* knots, const double* polynomials, const double* ends,
                             const double* torques, double t, double* motion);
