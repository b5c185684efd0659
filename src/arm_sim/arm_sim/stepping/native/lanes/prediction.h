/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick with events will ask for if no event occurs, computed beforehand for several arms at a time.
 *
 * The engine of one arm looks its questions up here and computes those that are not answered, such as all that follow from
 * an event. Answers are those of the same functions for the same bits: the motion does not depend on what is predicted.
 *
 * Arrays may have no elements, which C and C++ know as an extension alone: hence `__extension__`.
 */

#pragma once
#include "scene.h"

#include <string.h>

#define MC (3 * NC)

/* Numbers in modes_t after the tunable ones, loads_t, geometry_t and inertia_t. */
#define MODES (ND + NQ + NK + 5 * NC)
#define LOADS (NU + 7 * NC + NX)
#define NEARS (NU + 3 * NC) /* load and force of them */
#define PLACES (7 * NC)
#define INERTIA (9 * NC * NC + 3 * NC * NU + 3 * NC)

/* Where the contacts are. */
static inline void find_places(const real* x, real* found) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  arg[0] = x;
  for (int i = 0; i < 3; ++i) res[i] = found + i * MC;
  contact_geometry(arg, res, iw, w, 0);
}

/* Whether every joint slides and every contact is apart, in modes after the tunable numbers. */
static inline int all_moves(const double* modes) {
  int moves = 1;
  for (int i = 0; i < ND; ++i) moves &= modes[i] != 0.0;
  for (int k = 0; k < NC; ++k) moves &= modes[ND + NQ + NK + 5 * k] == 0.0; /* closed, of five */
  return moves;
}

/* Whether numbers are the same, bit for bit. */
static inline int same(const double* a, const double* b, int count) {
  int equal = 1;
  for (int i = 0; equal && i < count; ++i) {
    long long bits[2];
    memcpy(bits, a + i, sizeof *a);
    memcpy(bits + 1, b + i, sizeof *b);
    equal = bits[0] == bits[1];
  }
  return equal;
}

/* Whether loads at a step's stage at its end tell of those at its end: under error control they are the same, and without
 * internal states they do not swing within a step. */
#define STEADY (ADAPTIVE || NX == 2 * NU)

#define NEAR 0.1 /* distance to a limit at which it may be reached within a step, relative to the limit */

/* Bounds of a cubic by its Bernstein coefficients, from its ends and its slopes there. */
static inline void bound_cubic(real begin, real slope, real end, real end_slope, real h, real* low, real* high) {
  const real third = h / 3.0, b = begin + third * slope, c = end - third * end_slope;
  *low = fmin(fmin(begin, end), fmin(b, c));
  *high = fmax(fmax(begin, end), fmax(b, c));
}

/* Bounds of a number of the state inside a step of length h with its continuous output: those of the cubic through its ends,
 * widened by twice the distance of the cubic from the middle. */
static inline void bound_inside(const real* x, const real* next, const real* inside, real h, int i, real* low, real* high) {
  const real third = h / 3.0, a = third * inside[i], b = third * inside[NX + i];
  const real bend = 2.0 * fabs(inside[2 * NX + i] - 0.5 * (x[i] + next[i]) - 0.375 * (a - b));
  bound_cubic(x[i], inside[i], next[i], inside[NX + i], h, low, high);
  *low -= bend;
  *high += bend;
}

/* Continuous output of a step: derivatives at its ends, and the state in its middle. */
typedef struct {
  double slope[2][NX], middle[NX];
} dense_output_t;

__extension__ typedef struct {
  double x[NX], u[NU], p[NP + MODES]; /* beginning of a tick, its command, and its probable modes */
  double length;                      /* of the tick */
  double geometry[PLACES], anchor[2 * NC]; /* at its beginning */
  long long rests, slides, closes; /* whether loads, the inertia, and closed contacts will be asked for */
  double loads[LOADS], inertia[INERTIA];    /* at the beginning ... */
  double after[NX], geometry_after[PLACES]; /* ... and at the end, ... */
  double closed[2 * NU];                    /* ... which is this with closed contacts */
  dense_output_t inside;                          /* of the step from the beginning to the end ... */
  long long nears;                          /* ... and whether this is known: ... */
  double near[NEARS];                       /* ... loads and forces at its stage at the end */
} prediction_t;

/* A tick without events, for derivatives: one smooth motion. */
__extension__ typedef struct {
  double p[NP + MODES], grip[NC]; /* its modes, and the fraction of its normal force up to which a contact sticks */
  double begin[NX], end[NX], after[NX]; /* the motion's ends, and the state after the tick, with closed contacts */
} event_free_t;

/* Functions of the engine of one arm: find the modes and the anchors of a tick from its beginning, and what will be asked
 * for; make the tick, return 0 if it cannot be computed; make a tick without events, return 0 if there is one. */
typedef struct {
  void (*predict)(prediction_t* tick);
  int (*predicted_tick)(const prediction_t* tick, double* after);
  int (*event_free_tick)(const prediction_t* tick, event_free_t* found);
} engine_t;
