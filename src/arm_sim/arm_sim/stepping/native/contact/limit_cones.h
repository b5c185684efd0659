/* SPDX-License-Identifier: Apache-2.0
 *
 * The limits of a set of parts as cones in which the amounts of its self-stresses put its reactions.
 */

#pragma once
#include "contact/self_stresses.h"
#include "numerics/cone_program.h"

#define SMALL_PART 1e-3  /* smallest unit of a limit, relative to the largest of its kind in the set */

/* The limits of one set; unknowns are the amounts of its self-stresses, and one more. */
typedef struct {
  conic_t conic;
  int *part, *side; /* of each cone: its part, and bound of a joint */
  double *unit, *amount; /* units of the limits and of the unknowns */
  const double** stress;
} limits_t;

/* Declare limits and their arrays. */
#define LOCAL_LIMITS(limits) \
  double limits##_h[MOST_ROWS], limits##_G[MOST_ROWS * MOST_UNKNOWNS], limits##_unit[PARTS], limits##_amount[SHARES]; \
  int limits##_size[MOST_CONES], limits##_part[MOST_CONES], limits##_side[MOST_CONES]; \
  const double* limits##_stress[SHARES]; \
  limits_t limits = {{0, 0, 0, limits##_size, limits##_h, limits##_G}, \
                     limits##_part, \
                     limits##_side, \
                     limits##_unit, \
                     limits##_amount, \
                     limits##_stress}

/* Size of the reaction of a part and of its limits. */
static double size_of(const part_t* part) {
  const double* r = part->force;
  if (part->sticks) return fmax(part->fraction * fabs(r[0]), hypot(r[1], r[2]));
  const double least = part->least > -INFINITY ? fabs(part->least) : 0.0, most = part->most < INFINITY ? part->most : 0.0;
  return fmax(fabs(r[0]), fmax(least, most));
}

/* Units of the limits of a set's parts, each its own unless that is zero or very small; and of the amounts. */
static void find_units(const scene_t* scene, const part_t* parts, const int* set, int number, limits_t* to) {
  double largest[2], moved[2]; /* of joints and contacts: size, and entries of self-stresses */
  for (int i = 0; i < 2; ++i) largest[i] = moved[i] = 0.0;
  for (int i = 0; i < PARTS; ++i) {
    to->unit[i] = size_of(parts + i);
    if (set[i] == number) largest[i >= NU] = fmax(largest[i >= NU], to->unit[i]);
  }
  for (int j = 0; j < to->conic.unknowns - 1; ++j)
    for (int i = 0; i < FORCES; ++i) moved[i < MC] = fmax(moved[i < MC], fabs(to->stress[j][i]));
  for (int i = 0; i < PARTS; ++i) {
    const int kind = i >= NU;
    const double other = moved[!kind] > 0.0 ? largest[!kind] * moved[kind] / moved[!kind] : 0.0;
    to->unit[i] = fmax(to->unit[i], largest[kind] > 0.0 ? SMALL_PART * largest[kind] : other > 0.0 ? other : 1.0);
  }
  for (int j = 0; j < to->conic.unknowns - 1; ++j) {
    double most = 0.0;
    for (int i = 0; i < FORCES; ++i) most = fmax(most, fabs(to->stress[j][i]) / to->unit[part_of(scene, i)]);
    to->amount[j] = 1.0 / most;
  }
}

/* Append a row: a constant, a multiple of a reaction in the self-stresses, and the last unknown's coefficient. */
static void add_row(limits_t* to, double constant, double factor, int reaction, double last) {
  double* row = to->conic.G + to->conic.unknowns * to->conic.rows;
  to->conic.h[to->conic.rows++] = constant;
  for (int j = 0; j < to->conic.unknowns - 1; ++j)
    row[j] = factor == 0.0 ? 0.0 : factor * to->stress[j][reaction] * to->amount[j];
  row[to->conic.unknowns - 1] = last;
}

static void end_cone(limits_t* to, int part, int side, int rows) {
  to->conic.size[to->conic.cones] = rows;
  to->side[to->conic.cones] = side;
  to->part[to->conic.cones++] = part;
}

/* The limits of a part in its units, enlarged by `more`, and by the last unknown times `last`. */
static void add_limits(const scene_t* scene, limits_t* to, const part_t* part, int i, double more, double last) {
  const double *r = part->force, unit = 1.0 / to->unit[i];
  const int first = i < NU ? MC + i : 3 * (i - NU);
  if (part->sticks) {
    add_row(to, part->fraction * r[0] * unit + more, part->fraction * unit, first, last);
    for (int k = 1; k < 3; ++k) add_row(to, r[k] * unit, unit, first + k, 0.0);
    end_cone(to, i, 0, 3);
    return;
  }
  if (part->least > -INFINITY) {
    add_row(to, (r[0] - part->least) * unit + more, unit, first, last);
    end_cone(to, i, -1, 1);
  }
  if (part->most < INFINITY) {
    add_row(to, (part->most - r[0]) * unit + more, -unit, first, last);
    end_cone(to, i, 1, 1);
  }
}

static void begin_limits(const scene_t* scene, limits_t* to, const part_t* parts, const stresses_t* from, int number,
                         double more, double last) {
  to->conic.cones = to->conic.rows = 0;
  to->conic.unknowns = 1;
  for (int j = 0; j < from->count; ++j)
    if (from->of[j] == number) to->stress[to->conic.unknowns++ - 1] = from->stress + FORCES * j;
  find_units(scene, parts, from->set, number, to);
  for (int i = 0; i < PARTS; ++i)
    if (from->set[i] == number) add_limits(scene, to, parts + i, i, more, last);
}

/* Smallest last unknown for which y, otherwise given, is inside all cones, as all depend on it. */
static double excess_of(const conic_t* of, const double* y) {
  double most = 0.0;
  for (int k = 0, i = 0; k < of->cones; i += of->size[k++]) {
    double s[3];
    for (int j = 0; j < of->size[k]; ++j) s[j] = of->h[i + j] + dot(of->G + of->unknowns * (i + j), y, of->unknowns - 1);
    most = fmax(most, (of->size[k] == 3 ? hypot(s[1], s[2]) : 0.0) - s[0]);
  }
  return most;
}
