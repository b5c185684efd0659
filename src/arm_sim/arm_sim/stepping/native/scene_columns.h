/* SPDX-License-Identifier: Apache-2.0
 *
 * The generated functions of columns that the engine asks of a scene, see scene.h.
 */
#pragma once
#include "scene.h"
#ifdef ALONE
#include "../../../../arm_dynamics/arm_dynamics/codegen/native/columns.h"

#define COLUMNS(name) void name(const real* c, const column* const* arg, column* res)
COLUMNS(carry);
COLUMNS(limit);
COLUMNS(back_q);
COLUMNS(back_rest);
COLUMNS(moving_carry);
COLUMNS(moving_back_q);
COLUMNS(moving_back_rest);
COLUMNS(stretch);
COLUMNS(begin_at_rest);
COLUMNS(end_at_rest);
#endif
