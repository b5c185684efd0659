/* SPDX-License-Identifier: Apache-2.0
 *
 * Statically indeterminate sets: joints and contacts at rest whose reactions statics does not determine.
 *
 * Two rails that a rod connects, or a rail and a table, share their load in many ways: all that differ by a self-stress, a
 * combination of reactions that causes no motion. The parts hold while any of these distributions is within all static limits
 * (the static theorem of limit analysis: Moreau, "Application of convex analysis to the treatment of elastoplastic systems",
 * Springer Lecture Notes in Mathematics 503, 1976; with friction cones, Murray, Li, Sastry, A Mathematical Introduction to
 * Robotic Manipulation, 1994, section 5.3). That is the case if the least s for which all limits, enlarged by s, can be
 * satisfied is not positive: a linear limits over second-order cones, for each set of parts that share self-stresses. Its
 * dual solution is the motion in which the set gives way.
 */

#pragma once
#include "contact/limit_cones.h"

#define LEAST_EXCESS -1.0       /* s below which more margin is not searched for */
#define EXCESS_ROUNDING 1e-10   /* s up to which a set holds: that of the solution is accurate to less */
#define CERTAIN_EXCESS -2e-9    /* s at which a set certainly holds: no smaller one is searched for */

/* Which parts hold together.
 *
 * set:    of each part: its set of self-stresses, from 1 on; 0: none
 * excess: of each set, at most one for each force: the s above, or a clearly negative one
 * amount: of each part: of the motion in which its set gives way
 * motion: of each part: direction of that motion, two numbers
 */
typedef struct {
  double *set, *excess, *amount, *motion;
} indeterminate_t;
#define INDETERMINATE (4 * PARTS + FORCES + 1)

static indeterminate_t indeterminate_of(const scene_t* scene, double* numbers) {
  indeterminate_t sets = {numbers, numbers + PARTS, numbers + PARTS + FORCES + 1, numbers + 2 * PARTS + FORCES + 1};
  return sets;
}

/* The least s of a set, or a clearly negative one; the motion in which it gives way; the amounts of its self-stresses. */
static double find_excess(const scene_t* scene, const part_t* parts, const stresses_t* from, int set_number,
                          indeterminate_t* sets, double* y) {
  double z[MOST_ROWS];
  LOCAL_LIMITS(limits);
  begin_limits(scene, &limits, parts, from, set_number, 0.0, 1.0);
  add_row(&limits, -LEAST_EXCESS, 0.0, 0, 1.0);
  end_cone(&limits, -1, 0, 1);
  for (int j = 0; j < limits.stresses; ++j) y[j] = 0.0;
  y[limits.stresses] = 1.0 + excess_of(&limits.conic, y);
  const double excess = least_last(scene, &limits.conic, y, z, CERTAIN_EXCESS);
  for (int k = 0, i = 0; k < limits.conic.cones; i += limits.conic.size[k++]) {
    const int part = limits.part[k];
    if (part < 0) continue;
    sets->amount[part] += z[i];
    sets->motion[2 * part] += limits.conic.size[k] == 3 ? z[i + 1] : limits.side[k] * z[i];
    sets->motion[2 * part + 1] += limits.conic.size[k] == 3 ? z[i + 2] : 0.0;
  }
  return excess;
}

/* Relative amount by which the limits of a part are exceeded by its own reaction. */
static double own_excess(const part_t* part) {
  const double* r = part->force;
  return part->sticks ? hypot(r[1], r[2]) - part->fraction * r[0] : fmax(part->lower - r[0], r[0] - part->upper);
}

/* Whether the own reaction of a part of a set is beyond its limits. */
static int is_beyond(const scene_t* scene, const part_t* parts, const stresses_t* stresses, int set_number) {
  int any = 0;
  for (int i = 0; i < PARTS; ++i) any |= stresses->set[i] == set_number && own_excess(parts + i) > 0.0;
  return any;
}

/* Find the sets that hold together, and the excess of those whose reactions of the least norm are beyond a limit; of all if
 * `always`. */
static void find_indeterminate(const scene_t* scene, const statics_t* statics, const part_t* parts, int always,
                               indeterminate_t* sets) {
  double y[SHARES + 1];
  LOCAL_STRESSES(stresses);
  find_stresses(scene, statics, parts, &stresses);
  clear(sets->set, INDETERMINATE);
  for (int i = 0; i < PARTS; ++i) sets->set[i] = stresses.set[i];
  for (int set_number = 1; set_number <= stresses.count; ++set_number) {
    const int beyond = always || is_beyond(scene, parts, &stresses, set_number);
    sets->excess[set_number] = beyond ? find_excess(scene, parts, &stresses, set_number, sets, y) : LEAST_EXCESS;
  }
}

/* Change reactions of the least norm, those of contacts and then of joints, to the nearest that are within all limits, in
 * units of these; of sets that do not hold they are kept. */
static void find_nearest(const scene_t* scene, const statics_t* statics, const part_t* parts, double* reaction) {
  LOCAL(indeterminate_t, sets, indeterminate_of, INDETERMINATE);
  double y[SHARES + 1];
  LOCAL_STRESSES(stresses);
  clear(sets.set, INDETERMINATE);
  find_stresses(scene, statics, parts, &stresses);
  for (int set_number = 1; set_number <= stresses.count; ++set_number) {
    double z[MOST_ROWS];
    if (!is_beyond(scene, parts, &stresses, set_number)) continue;
    if (find_excess(scene, parts, &stresses, set_number, &sets, y) > EXCESS_ROUNDING) continue;
    LOCAL_LIMITS(limits);
    begin_limits(scene, &limits, parts, &stresses, set_number, 2.0 * EXCESS_ROUNDING, 0.0);
    const int first = limits.conic.rows; /* of a cone in which the slack, to be least, bounds the length of the change */
    double* slack = y + limits.stresses;
    add_row(&limits, 0.0, 0.0, 0, 1.0);
    for (int i = 0; i < FORCES; ++i)
      if (stresses.set[part_of(scene, i)] == set_number) add_row(&limits, 0.0, 1.0 / limits.unit[part_of(scene, i)], i, 0.0);
    end_cone(&limits, -1, 0, limits.conic.rows - first);
    *slack = 1.0;
    for (int i = first; i < limits.conic.rows; ++i)
      *slack += fabs(dot(limits.conic.G + limits.conic.unknowns * i, y, limits.stresses));
    least_last(scene, &limits.conic, y, z, -INFINITY);
    for (int j = 0; j < limits.stresses; ++j)
      for (int i = 0; i < FORCES; ++i) reaction[i] += y[j] * limits.amount[j] * limits.stress[j][i];
  }
}
