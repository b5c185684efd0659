/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of one tick of one arm.
 */

#include "derivatives/sensitivities.h"
#include "derivatives/tangent_columns.h"

/* The state after a tick under the command r, and its derivatives by the state, the command and tunable quantities, NX rows of
 * NV. 0 if there are none since the tick begins in a kink, or has an event or comes so close to one that this does not
 * find them. */
EXPORTED int differentiate_tick(const scene_t* scene, const tangents_t* tangents, const engine_t* engine, const double* x,
                                const double* r, const double* p, double h, double* after, double* slopes) {
  double unit[NV * NV], kink;
  static const int8_t halted = 0;
  int8_t mark = 0;
  long long ticks_before_event;
  CALL(scene->nonsmooth, (x, r), (&kink));
  if (kink != 0.0) return 0;
  for (int i = 0; i < NV; ++i)
    for (int j = 0; j < NV; ++j) unit[i * NV + j] = i == j;
  const arms_t arms = {
      .x0 = x, .tau = r, .p = p, .h = h, .ticks = 1, .unfinished = &mark, .halted = &halted, .engine = engine};
  columns_t columns = {.initial = unit, .inputs = unit + NX * NV, .columns = slopes, .count = NV, .after = after};
  columns.starts_from_identity = columns.initial_state_varied = 1;
  columns.ticks_before_event = &ticks_before_event;
  propagate_ticks(scene, tangents, &arms, 0, 1, &columns);
  return !mark;
}
