/* SPDX-License-Identifier: Apache-2.0
 *
 * The limits of a set of parts as cones in which the amounts of its self-stresses put its reactions.
 */

#pragma once
#include "contact/self_stresses.h"
#include "numerics/cone_program.h"

#define SMALLEST_UNIT 1e-3 /* smallest unit of a limit, relative to the largest of its kind in the set */

/* The limits of one set; unknowns are the amounts of its self-stresses, and a slack by which all limits are enlarged. */
typedef struct {
  int stresses;          /* number of the self-stresses of the set */
  const double** stress; /* the self-stresses of the set */
  double *unit, *amount; /* units of the limits of each part, and of the amounts */
  int *part, *side;      /* of each cone: its part, and bound of a joint */
  conic_t conic;
} limits_t;

/* Declare limits and their arrays. */
#define LOCAL_LIMITS(name) \
  double name##_h[MOST_ROWS], name##_G[MOST_ROWS * MOST_UNKNOWNS], name##_unit[PARTS], name##_amount[SHARES]; \
  int name##_size[MOST_CONES], name##_part[MOST_CONES], name##_side[MOST_CONES]; \
  const double* name##_stress[SHARES]; \
  limits_t name = { \
      0, name##_stress, name##_unit, name##_amount, name##_part, name##_side, {0, 0, 0, name##_size, name##_h, name##_G}}

/* Size of the reaction of a part and of its limits. */
static double size_of(const part_t* part) {
  const double* r = part->force;
  if (part->sticks) return fmax(part->fraction * fabs(r[0]), hypot(r[1], r[2]));
  const double lower = part->lower > -INFINITY ? fabs(part->lower) : 0.0, upper = part->upper < INFINITY ? part->upper : 0.0;
  return fmax(fabs(r[0]), fmax(lower, upper));
}

/* Smallest unit of limits of joints (0) or contacts (1): relative to the largest reaction of this kind in the set, or where
 * that is zero to that of the other kind, as their largest entries in the self-stresses relate. */
static double smallest_unit(const double largest[2], const double entry[2], int kind) {
  if (largest[kind] > 0.0) return SMALLEST_UNIT * largest[kind];
  const double transferred = entry[!kind] > 0.0 ? largest[!kind] * entry[kind] / entry[!kind] : 0.0;
  return transferred > 0.0 ? transferred : 1.0;
}

/* Units of the limits of a set's parts: each its own size, unless that is zero or very small. */
static void find_units(const scene_t* scene, const part_t* parts, const int* set, int set_number, limits_t* to) {
  double largest[2], entry[2]; /* by kind */
  clear(largest, 2);
  clear(entry, 2);
  for (int i = 0; i < PARTS; ++i) {
    to->unit[i] = size_of(parts + i);
    if (set[i] == set_number) largest[i >= NU] = fmax(largest[i >= NU], to->unit[i]);
  }
  for (int j = 0; j < to->stresses; ++j)
    for (int i = 0; i < FORCES; ++i) entry[i < MC] = fmax(entry[i < MC], fabs(to->stress[j][i]));
  for (int i = 0; i < PARTS; ++i) to->unit[i] = fmax(to->unit[i], smallest_unit(largest, entry, i >= NU));
}

/* Units of the amounts: in them, the largest entry of a self-stress, none of which is zero, is 1. */
static void find_amounts(const scene_t* scene, limits_t* to) {
  for (int j = 0; j < to->stresses; ++j) {
    double largest = 0.0;
    for (int i = 0; i < FORCES; ++i) largest = fmax(largest, fabs(to->stress[j][i]) / to->unit[part_of(scene, i)]);
    to->amount[j] = 1.0 / largest;
  }
}

/* Append a row: a constant, a multiple of a reaction in the self-stresses, and the coefficient of the slack. */
static void add_row(limits_t* to, double constant, double factor, int reaction, double slack) {
  double* row = to->conic.G + to->conic.unknowns * to->conic.rows;
  to->conic.h[to->conic.rows++] = constant;
  for (int j = 0; j < to->stresses; ++j) row[j] = factor == 0.0 ? 0.0 : factor * to->stress[j][reaction] * to->amount[j];
  row[to->stresses] = slack;
}

/* End a cone of the last rows, which is that of a part (-1: none), for a joint at its lower or upper bound (-1, 1). */
static void end_cone(limits_t* to, int part, int side, int rows) {
  to->conic.size[to->conic.cones] = rows;
  to->side[to->conic.cones] = side;
  to->part[to->conic.cones++] = part;
}

/* The limits of a part in its units, enlarged by `more`, and by the slack times `slack`. */
static void add_limits(const scene_t* scene, limits_t* to, const part_t* part, int i, double more, double slack) {
  const double *r = part->force, per_unit = 1.0 / to->unit[i];
  const int first = i < NU ? MC + i : 3 * (i - NU);
  if (part->sticks) {
    add_row(to, part->fraction * r[0] * per_unit + more, part->fraction * per_unit, first, slack);
    for (int k = 1; k < 3; ++k) add_row(to, r[k] * per_unit, per_unit, first + k, 0.0);
    end_cone(to, i, 0, 3);
    return;
  }
  if (part->lower > -INFINITY) {
    add_row(to, (r[0] - part->lower) * per_unit + more, per_unit, first, slack);
    end_cone(to, i, -1, 1);
  }
  if (part->upper < INFINITY) {
    add_row(to, (part->upper - r[0]) * per_unit + more, -per_unit, first, slack);
    end_cone(to, i, 1, 1);
  }
}

/* Set up the limits of a set, enlarged by `more`, and by the slack times `slack`. */
static void begin_limits(const scene_t* scene, limits_t* to, const part_t* parts, const stresses_t* from, int set_number,
                         double more, double slack) {
  to->conic.cones = to->conic.rows = to->stresses = 0;
  for (int j = 0; j < from->count; ++j)
    if (from->set_of_stress[j] == set_number) to->stress[to->stresses++] = from->stress + FORCES * j;
  to->conic.unknowns = to->stresses + 1;
  find_units(scene, parts, from->set, set_number, to);
  find_amounts(scene, to);
  for (int i = 0; i < PARTS; ++i)
    if (from->set[i] == set_number) add_limits(scene, to, parts + i, i, more, slack);
}

/* Smallest slack with which the amounts in y are inside all cones, as all depend on it. */
static double excess_of(const conic_t* of, const double* y) {
  double excess = 0.0;
  for (int k = 0, i = 0; k < of->cones; i += of->size[k++]) {
    double s[3];
    for (int j = 0; j < of->size[k]; ++j) s[j] = of->h[i + j] + dot(of->G + of->unknowns * (i + j), y, of->unknowns - 1);
    excess = fmax(excess, (of->size[k] == 3 ? hypot(s[1], s[2]) : 0.0) - s[0]);
  }
  return excess;
}
