/* SPDX-License-Identifier: Apache-2.0
 *
 * What holds together: joints and contacts at rest whose reactions statics does not determine.
 *
 * Two rails that a rod connects, or a rail and a table, share their load in many ways: all that differ by a self-stress, a
 * combination of reactions that causes no motion. The parts hold while any of these distributions is within all static limits
 * (the static theorem of limit analysis: Moreau, "Application of convex analysis to the treatment of elastoplastic systems",
 * Springer Lecture Notes in Mathematics 503, 1976; with friction cones, Murray, Li, Sastry, A Mathematical Introduction to
 * Robotic Manipulation, 1994, section 5.3). That is the case if the least s for which all limits, enlarged by s, can be
 * satisfied is not positive: a linear problem over second-order cones, for each set of parts that share self-stresses. Its
 * dual solution is the motion in which the set gives way.
 */

#pragma once
#include "contact/friction_cones.h"
#include "numerics/cone_program.h"

#define PARTS (NU + NC)         /* joints, then contacts */
#define FORCES (MC + NU)        /* reactions: those of contacts, then those of joints */
#define SHARES (NM + FORCES)    /* forces of constraints, and reactions */
#define DEPENDS 1e-10    /* pivot of the balance of forces that is rounding; its columns are scaled to 1 */
#define CANCELS 1e-12    /* the same of an entry of a self-stress, and of a whole column */
#define SMALL_PART 1e-3  /* smallest unit of a limit, relative to the largest of its kind in the set */
#define MOST_ROOM -1.0   /* s below which more room is not searched for */
#define HOLDS 1e-10      /* s up to which a set holds: that of the solution is accurate to less */
#define CLEARLY -2e-9    /* s at which a set certainly holds: no smaller one is searched for */
#define LIMIT_ROWS (2 * NU + MC)

/* The balance of forces at a state. */
typedef struct {
  real* push;     /* joint torques per force of a constraint, and per unknown force of a contact */
  real* reaction; /* holding torques of the least norm, ... */
  real* capacity; /* ... and the largest that dry friction bears, pushed forwards and backwards */
  real* drift;    /* accelerations of the constraints' rows without acceleration of the joints */
} statics_t;
#define STATICS (NU * (NM + MC) + 3 * NU + NM)

static statics_t statics_of(const scene_t* scene, real* numbers) {
  real* reaction = numbers + NU * (NM + MC);
  statics_t statics = {numbers, reaction, reaction + NU, reaction + 3 * NU};
  return statics;
}

/* A part: a held joint with the bounds of its reaction; a contact that sticks up to a fraction of its normal force, or only
 * presses; or none of these. */
typedef struct {
  int held, sticks;
  double force[3], least, most, fraction;
} part_t;
static const part_t loose = {0, 0, {0.0, 0.0, 0.0}, 0.0, 0.0, 0.0};

/* Self-stresses, and the sets of parts that share them. */
typedef struct {
  int count, sets;
  int *set, *of; /* of each part and of each stress, its set from 1 on; 0 for what statics determines */
  double* stress;
} stresses_t;

/* Which parts hold together. */
typedef struct {
  double* set;          /* as above */
  double*
      excess; /* of each set, at most one for each force, the s above; where it is clearly negative, that of some distribution */
  double *share, *way; /* of each part, in the motion in which its set gives way: amount, direction of two numbers */
} indeterminate_t;
#define INDETERMINATE (4 * PARTS + FORCES + 1)

static indeterminate_t indeterminate_of(const scene_t* scene, double* numbers) {
  indeterminate_t sets = {numbers, numbers + PARTS, numbers + PARTS + FORCES + 1, numbers + 2 * PARTS + FORCES + 1};
  return sets;
}

/* Gauss-Jordan elimination with complete pivoting in columns from `begin` to before `end`; `basic` receives the column of
 * each row that gets a pivot, else it remains -1. */
static void eliminate(int rows, int columns, double* T, int begin, int end, int* basic) {
  for (;;) {
    int row = -1, column = 0;
    double largest = DEPENDS;
    for (int i = 0; i < rows; ++i)
      for (int j = begin; j < end && basic[i] < 0; ++j)
        if (fabs(T[columns * i + j]) > largest) {
          largest = fabs(T[columns * i + j]);
          row = i;
          column = j;
        }
    if (row < 0) return;
    basic[row] = column;
    const double pivot = T[columns * row + column];
    for (int j = 0; j < columns; ++j) T[columns * row + j] /= pivot;
    for (int i = 0; i < rows; ++i) {
      const double factor = T[columns * i + column];
      if (i == row || factor == 0.0) continue;
      for (int j = 0; j < columns; ++j) T[columns * i + j] -= factor * T[columns * row + j];
      T[columns * i + column] = 0.0;
    }
  }
}

static int part_of(const scene_t* scene, int reaction) { return reaction < MC ? NU + reaction / 3 : reaction - MC; }

/* The balance with columns of size 1, or zero where a force is not transmitted or moves nothing. */
static void scale_columns(const scene_t* scene, const statics_t* statics, const part_t* parts, double* T, double* size) {
  double widest = 0.0;
  for (int j = 0; j < SHARES; ++j) {
    size[j] = 0.0;
    for (int i = 0; i < NU; ++i) {
      T[SHARES * i + j] = j < NM + MC ? statics->push[i + NU * j] : j - NM - MC == i && parts[i].held ? -1.0 : 0.0;
      size[j] = fmax(size[j], fabs(T[SHARES * i + j]));
    }
    widest = fmax(widest, size[j]);
  }
  for (int j = 0; j < SHARES; ++j) {
    if (size[j] <= CANCELS * widest) size[j] = 0.0;
    for (int i = 0; i < NU; ++i) T[SHARES * i + j] = size[j] > 0.0 ? T[SHARES * i + j] / size[j] : 0.0;
  }
}

/* Number the sets of parts that share self-stresses. */
static void find_sets(const scene_t* scene, stresses_t* stresses) {
  int* set = stresses->set;
  stresses->sets = 0;
  for (int i = 0; i < PARTS; ++i) set[i] = 0;
  for (int j = 0; j < stresses->count; ++j) {
    const int number = stresses->of[j] = ++stresses->sets;
    for (int i = 0; i < FORCES; ++i) {
      const int other = set[part_of(scene, i)];
      if (stresses->stress[FORCES * j + i] == 0.0 || other == number) continue;
      for (int k = 0; k < PARTS && other; ++k) set[k] = set[k] == other ? number : set[k];
      for (int k = 0; k < j && other; ++k) stresses->of[k] = stresses->of[k] == other ? number : stresses->of[k];
      set[part_of(scene, i)] = number;
    }
  }
}

/* Self-stresses: a basis of the combinations of reactions that move nothing. */
static void find_stresses(const scene_t* scene, const statics_t* statics, const part_t* parts, stresses_t* stresses) {
  double T[NU * SHARES], size[SHARES];
  int basic[NU];
  scale_columns(scene, statics, parts, T, size);
  for (int i = 0; i < NU; ++i) basic[i] = -1;
  eliminate(NU, SHARES, T, 0, NM, basic); /* forces of constraints have no limits: they follow from the others */
  eliminate(NU, SHARES, T, NM, SHARES, basic);
  stresses->count = 0;
  for (int j = NM; j < SHARES; ++j) {
    int free = size[j] > 0.0;
    for (int i = 0; i < NU; ++i) free &= basic[i] != j;
    if (!free) continue;
    double* stress = stresses->stress + FORCES * stresses->count++;
    for (int i = 0; i < FORCES; ++i) stress[i] = 0.0;
    stress[j - NM] = 1.0 / size[j];
    for (int i = 0; i < NU; ++i)
      if (basic[i] >= NM && fabs(T[SHARES * i + j]) > CANCELS) stress[basic[i] - NM] = -T[SHARES * i + j] / size[basic[i]];
  }
  find_sets(scene, stresses);
}

/* The limits of one set as a problem over cones; its unknowns are the amounts of its self-stresses, and one more. */
typedef struct {
  int cones, rows, unknowns;
  int *size, *part, *side; /* of each cone: rows, part, bound of a joint */
  double *unit, *amount; /* units of the limits and of the unknowns */
  const double** stress;
  double *h, *G;
} problem_t;

/* Size of the reaction of a part and of its limits. */
static double size_of(const part_t* part) {
  const double* r = part->force;
  if (part->sticks) return fmax(part->fraction * fabs(r[0]), hypot(r[1], r[2]));
  const double least = part->least > -INFINITY ? fabs(part->least) : 0.0, most = part->most < INFINITY ? part->most : 0.0;
  return fmax(fabs(r[0]), fmax(least, most));
}

/* Units of the limits of a set's parts, each its own unless that is zero or very small; and of the amounts. */
static void find_units(const scene_t* scene, const part_t* parts, const int* set, int number, problem_t* to) {
  double largest[2], moved[2]; /* of joints and contacts: size, and entries of self-stresses */
  for (int i = 0; i < 2; ++i) largest[i] = moved[i] = 0.0;
  for (int i = 0; i < PARTS; ++i) {
    to->unit[i] = size_of(parts + i);
    if (set[i] == number) largest[i >= NU] = fmax(largest[i >= NU], to->unit[i]);
  }
  for (int j = 0; j < to->unknowns - 1; ++j)
    for (int i = 0; i < FORCES; ++i) moved[i < MC] = fmax(moved[i < MC], fabs(to->stress[j][i]));
  for (int i = 0; i < PARTS; ++i) {
    const int kind = i >= NU;
    const double other = moved[!kind] > 0.0 ? largest[!kind] * moved[kind] / moved[!kind] : 0.0;
    to->unit[i] = fmax(to->unit[i], largest[kind] > 0.0 ? SMALL_PART * largest[kind] : other > 0.0 ? other : 1.0);
  }
  for (int j = 0; j < to->unknowns - 1; ++j) {
    double most = 0.0;
    for (int i = 0; i < FORCES; ++i) most = fmax(most, fabs(to->stress[j][i]) / to->unit[part_of(scene, i)]);
    to->amount[j] = 1.0 / most;
  }
}

/* Append a row: a constant, a multiple of a reaction in the self-stresses, and the last unknown's coefficient. */
static void add_row(problem_t* to, double constant, double factor, int reaction, double last) {
  double* row = to->G + to->unknowns * to->rows;
  to->h[to->rows++] = constant;
  for (int j = 0; j < to->unknowns - 1; ++j) row[j] = factor == 0.0 ? 0.0 : factor * to->stress[j][reaction] * to->amount[j];
  row[to->unknowns - 1] = last;
}

static void end_cone(problem_t* to, int part, int side, int rows) {
  to->size[to->cones] = rows;
  to->side[to->cones] = side;
  to->part[to->cones++] = part;
}

/* The limits of a part in its units, enlarged by `more`, and by the last unknown times `last`. */
static void add_limits(const scene_t* scene, problem_t* to, const part_t* part, int i, double more, double last) {
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

static void begin_problem(const scene_t* scene, problem_t* to, const part_t* parts, const stresses_t* from, int number,
                          double more, double last) {
  to->cones = to->rows = 0;
  to->unknowns = 1;
  for (int j = 0; j < from->count; ++j)
    if (from->of[j] == number) to->stress[to->unknowns++ - 1] = from->stress + FORCES * j;
  find_units(scene, parts, from->set, number, to);
  for (int i = 0; i < PARTS; ++i)
    if (from->set[i] == number) add_limits(scene, to, parts + i, i, more, last);
}

/* Smallest last unknown for which y, otherwise given, is inside all cones of the problem, as all depend on it. */
static double excess_of(const problem_t* of, const double* y) {
  double most = 0.0;
  for (int k = 0, i = 0; k < of->cones; i += of->size[k++]) {
    double s[3];
    for (int j = 0; j < of->size[k]; ++j) s[j] = of->h[i + j] + dot(of->G + of->unknowns * (i + j), y, of->unknowns - 1);
    most = fmax(most, (of->size[k] == 3 ? hypot(s[1], s[2]) : 0.0) - s[0]);
  }
  return most;
}

/* The least s of a set, or one that is clearly negative; the motion in which it gives way; the amounts of its self-stresses. */
static double find_excess(const scene_t* scene, const part_t* parts, const stresses_t* from, int number, indeterminate_t* sets,
                          double* y) {
  double h[LIMIT_ROWS + 1], G[(LIMIT_ROWS + 1) * MOST_UNKNOWNS], z[LIMIT_ROWS + 1], unit[PARTS], amount[SHARES];
  int size[MOST_CONES], of_part[MOST_CONES], side[MOST_CONES];
  const double* stress[SHARES];
  problem_t problem = {0, 0, 0, size, of_part, side, unit, amount, stress, h, G};
  begin_problem(scene, &problem, parts, from, number, 0.0, 1.0);
  add_row(&problem, -MOST_ROOM, 0.0, 0, 1.0);
  end_cone(&problem, -1, 0, 1);
  const int last = problem.unknowns - 1;
  for (int j = 0; j < last; ++j) y[j] = 0.0;
  y[last] = 1.0 + excess_of(&problem, y);
  const conic_t conic = {problem.cones, problem.rows, problem.unknowns, problem.size, h, G};
  const double excess = least_last(scene, &conic, y, z, CLEARLY);
  for (int k = 0, i = 0; k < problem.cones; i += problem.size[k++]) {
    const int part = problem.part[k];
    if (part < 0) continue;
    sets->share[part] += z[i];
    sets->way[2 * part] += problem.size[k] == 3 ? z[i + 1] : problem.side[k] * z[i];
    sets->way[2 * part + 1] += problem.size[k] == 3 ? z[i + 2] : 0.0;
  }
  return excess;
}

/* Relative amount by which the limits of a part are exceeded by its own reaction. */
static double own_excess(const part_t* part) {
  const double* r = part->force;
  return part->sticks ? hypot(r[1], r[2]) - part->fraction * r[0] : fmax(part->least - r[0], r[0] - part->most);
}

/* Whether the own reaction of a part of a set is beyond its limits. */
static int is_beyond(const scene_t* scene, const part_t* parts, const stresses_t* stresses, int number) {
  int any = 0;
  for (int i = 0; i < PARTS; ++i) any |= stresses->set[i] == number && own_excess(parts + i) > 0.0;
  return any;
}

/* Find what holds together, and whether it does, where reactions of the least norm are beyond a limit; else, or if
 * `always`, everywhere. */
static void find_indeterminate(const scene_t* scene, const statics_t* statics, const part_t* parts, int always,
                               indeterminate_t* sets) {
  int set[PARTS], of[SHARES];
  double y[SHARES + 1], stress[FORCES * SHARES];
  stresses_t stresses = {0, 0, set, of, stress};
  find_stresses(scene, statics, parts, &stresses);
  clear(sets->set, INDETERMINATE);
  for (int i = 0; i < PARTS; ++i) sets->set[i] = set[i];
  for (int number = 1; number <= stresses.sets; ++number) {
    const int beyond = always || is_beyond(scene, parts, &stresses, number);
    sets->excess[number] = beyond ? find_excess(scene, parts, &stresses, number, sets, y) : MOST_ROOM;
  }
}

/* Change reactions of the least norm, those of contacts and then of joints, to the nearest that are within all limits, in
 * units of these; of sets that do not hold they are kept. */
static void find_nearest(const scene_t* scene, const statics_t* statics, const part_t* parts, double* reaction) {
  LOCAL(indeterminate_t, sets, indeterminate_of, INDETERMINATE);
  int set[PARTS], of[SHARES];
  double y[SHARES + 1], stress[FORCES * SHARES];
  stresses_t stresses = {0, 0, set, of, stress};
  clear(sets.set, INDETERMINATE);
  find_stresses(scene, statics, parts, &stresses);
  for (int number = 1; number <= stresses.sets; ++number) {
    double h[MOST_ROWS], G[MOST_ROWS * MOST_UNKNOWNS], z[MOST_ROWS];
    if (!is_beyond(scene, parts, &stresses, number)) continue;
    if (find_excess(scene, parts, &stresses, number, &sets, y) > HOLDS) continue;
    double unit[PARTS], amount[SHARES];
    int size[MOST_CONES], of_part[MOST_CONES], side[MOST_CONES];
    const double* of_stress[SHARES];
    problem_t problem = {0, 0, 0, size, of_part, side, unit, amount, of_stress, h, G};
    begin_problem(scene, &problem, parts, &stresses, number, 2.0 * HOLDS, 0.0);
    const int limits = problem.rows, last = problem.unknowns - 1;
    add_row(&problem, 0.0, 0.0, 0, 1.0);
    for (int i = 0; i < FORCES; ++i)
      if (stresses.set[part_of(scene, i)] == number) add_row(&problem, 0.0, 1.0 / problem.unit[part_of(scene, i)], i, 0.0);
    end_cone(&problem, -1, 0, problem.rows - limits);
    y[last] = 1.0;
    for (int i = limits; i < problem.rows; ++i) y[last] += fabs(dot(G + problem.unknowns * i, y, last));
    const conic_t conic = {problem.cones, problem.rows, problem.unknowns, problem.size, h, G};
    least_last(scene, &conic, y, z, -INFINITY);
    for (int j = 0; j < last; ++j)
      for (int i = 0; i < FORCES; ++i) reaction[i] += y[j] * problem.amount[j] * problem.stress[j][i];
  }
}
