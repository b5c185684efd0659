/* SPDX-License-Identifier: Apache-2.0
 *
 * Numbers of a scene by joint and contact, and what its functions cost. They are defined with its functions, and are all that
 * the engine needs to know of it besides sizes and features: its code may be shared by scenes with the same.
 */

#pragma once
#include "scene.h"

/* Lower and upper stops, beyond every position where there is none: all, rigid ones with their restitution, compliant ones. */
extern const double stop_place[2][NU], rigid_stop[2][NU], rebound_of[2][NU], soft_stop[2][NU];
extern const double static_level[NU]; /* of dry friction */
extern const double wave_number[NU]; /* phase of the fastest wave in a joint's position, in radians for each radian or metre */

/* Coefficients of sliding and of static friction, and restitutions of contacts. */
__extension__ extern const double friction[NC], holding[NC], restitution[NC];

/* Operations of one call of functions, and those in a tick above which it is time-stepped. */
extern const long long step_cost, slope_cost, loads_cost, inertia_cost, strike_cost, statics_cost, most_work;
