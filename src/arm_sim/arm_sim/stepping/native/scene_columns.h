/* SPDX-License-Identifier: Apache-2.0
 *
 * For editors, with scene.h: the generated functions of tangents.c.
 */
#pragma once
#include "scene.h"
#include "../../../../arm_dynamics/arm_dynamics/codegen/native/columns.h"

GENERATED(advance);
GENERATED(moving_advance);

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
