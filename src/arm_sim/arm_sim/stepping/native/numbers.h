/* SPDX-License-Identifier: Apache-2.0
 *
 * Numbers of a scene with events, by joint and contact.
 *
 * With the costs of its functions they are all that an engine needs to know of a scene besides sizes and features, so that its
 * code may be shared: where it is a unit of its own, OF_SCENE declares them there, and defines them in the unit of the scene.
 *
 * Required definitions: NU (joints), NC (contacts), STATIC, FRICTION, HOLDING, RESTITUTION (brace lists); with RIGID also LOWER,
 * UPPER, LOWER_REBOUND and UPPER_REBOUND; SOFT_LOWER, SOFT_UPPER; WAVES; OF_SCENE and VALUE (how a number is declared).
 */

#pragma once
#include "stops.h"

OF_SCENE double static_level[NU] VALUE(STATIC);
__extension__ OF_SCENE double friction[NC] VALUE(FRICTION); /* coefficients of sliding friction ... */
__extension__ OF_SCENE double holding[NC] VALUE(HOLDING);   /* ... and of static friction */
__extension__ OF_SCENE double restitution[NC] VALUE(RESTITUTION);

#ifdef RIGID
OF_SCENE double lower_stop[NU] VALUE(LOWER);
OF_SCENE double upper_stop[NU] VALUE(UPPER);
OF_SCENE double rebound_of[2][NU] VALUE({LOWER_REBOUND, UPPER_REBOUND});
#endif
/* Phase of the fastest wave in a joint's position, in radians for each radian or metre. */
OF_SCENE double wave_number[NU] VALUE(WAVES);
OF_SCENE double soft_stop[2][NU] VALUE({SOFT_LOWER, SOFT_UPPER});
