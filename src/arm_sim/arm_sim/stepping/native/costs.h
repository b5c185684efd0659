/* SPDX-License-Identifier: Apache-2.0
 *
 * What the functions of a scene with events cost, beside its other numbers.
 *
 * Required definitions: MOST_WORK (operations of the generated functions in a tick above which it is time-stepped), and
 * COST_STEP, COST_SLOPE, COST_LOADS, COST_INERTIA, COST_STRIKE, COST_STATICS (operations of one call).
 */

#pragma once
#include "numbers.h"

typedef struct {
  long long most, step, slope, loads, inertia, strike, statics;
} costs_t;
OF_SCENE costs_t costs VALUE({MOST_WORK, COST_STEP, COST_SLOPE, COST_LOADS, COST_INERTIA, COST_STRIKE, COST_STATICS});
