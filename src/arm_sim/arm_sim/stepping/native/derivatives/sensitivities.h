/* SPDX-License-Identifier: Apache-2.0
 *
 * What the derivatives of a tick with events have in common.
 *
 * A matrix of derivatives has a row for each number of the state and NV columns: by the state at the beginning of the tick,
 * the command that acts, and NT tunable quantities. Results of generated functions lie column by column.
 */

#pragma once
#include "modes/tick_record.h"

#define NW (NU + NT) /* inputs in a tick: command and tunable quantities */
#define NV (NX + NW)

/* Why a tick has no derivative. Python: MESSAGES of derivatives/refusals.py. */
enum refusal {
  NO_REFUSAL,
  DIVERGES,
  ACCUMULATE,
  TOO_MANY_STEPS,
  BEGINS_WITH_IMPACT,
  BEGINS_ON_BOUNDARY, /* guards */
  ENDS_ON_BOUNDARY,   /* guards */
  REDUCED_REBOUND,
  IMPACT_ON_EDGE, /* contact */
  UNLOADED_GEAR,  /* joint */
  JOINT_WOULD_GO_ON,
  CONTACT_WOULD_GO_ON, /* contact */
  STARTS_TO_SLIDE,
  STOPS_STRAIGHT,
  SAME_INSTANT,
  COINCIDE, /* guards */
  GRAZES,   /* guards, if they are known */
};

/* The tick, and how many and which guards, joints or contacts a refusal is about. */
typedef struct {
  const real* u;
  double length;
  long long* subjects;
} tick_t;

/* A refusal because of one guard, joint or contact. */
static enum refusal refuse(const tick_t* tick, enum refusal reason, int index) {
  tick->subjects[0] = 1;
  tick->subjects[1] = index;
  return reason;
}

/* Whether friction or a stop holds a joint in a segment. */
static int is_held(const scene_t* scene, const record_t* segment, int joint) {
  return ND && segment->p.direction[joint] == 0.0;
}

/* Add a matrix, column by column, times rows of NV columns. */
static void add_product(const scene_t* scene, int rows, int inner, const real* matrix, const real (*factor)[NV],
                        real (*sum)[NV]) {
  for (int i = 0; i < rows; ++i)
    for (int k = 0; k < inner; ++k)
      for (int j = 0; j < NV; ++j) sum[i][j] += matrix[k * rows + i] * factor[k][j];
}

/* Multiply the first `count` rows of derivatives, in place, by a square matrix, column by column. */
static void multiply_rows(const scene_t* scene, int count, const real* matrix, real (*rows)[NV]) {
  real product[NX][NV];
  memset(product, 0, sizeof product);
  add_product(scene, count, count, matrix, (const real(*)[NV])rows, product);
  memcpy(rows, product, (size_t)count * sizeof *rows);
}
