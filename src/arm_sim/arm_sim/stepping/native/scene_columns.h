/* SPDX-License-Identifier: Apache-2.0
 *
 * For editors, with scene.h: the generated functions of tangents.c.
 */
#pragma once
#include "scene.h"
#include "../../../../arm_dynamics/arm_dynamics/codegen/native/columns.h"

GENERATED(advance)

#define GENERATED_COLUMNS(name) void name(const real* c, const column* const* arg, column* res);
GENERATED_COLUMNS(carry)
GENERATED_COLUMNS(limit) GENERATED_COLUMNS(back_q) GENERATED_COLUMNS(back_rest) GENERATED_COLUMNS(stretch)
