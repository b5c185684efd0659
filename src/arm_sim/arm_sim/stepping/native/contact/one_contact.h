/* SPDX-License-Identifier: Apache-2.0
 *
 * Force on one contact with Coulomb friction, or its impulse.
 *
 * w = W r + c: motion of the point (normal, two tangents) under the force r, see contact_problem.h; mu: coefficient of
 * sliding friction.
 *
 * The cone is Coulomb's, not a pyramid: the direction in which a contact starts to slide is the root of a trigonometric
 * polynomial (Bonnefon, Daviet, "Quartic formulation of Coulomb 3D frictional contact", INRIA, 2011).
 */

#pragma once
#include "numerics/linear.h"

#define DIRECTION_INTERVALS 32 /* of the directions in which a contact may start to slide */
#define ROOT_STEPS 100         /* bisections to find the direction */
#define REFINEMENTS 2          /* steps that remove the effect of the regularization of a singular W */
#define LEAST_NORM 1e-8        /* fraction of the trace of W that regularizes it */
#define OWN_PART 1e-5          /* fraction of a row's own mobility that its regularization does not exceed */
#define BACKWARD_ROUNDING 1e-12 /* motion against its direction of a sliding contact, relative to that without forces */
#define FULL_CIRCLE 6.283185307179586
#define IMMOBILE 1e-20 /* fraction of the trace up to which a row cannot move */

/* State of a contact. */
enum contact_state { APART, SLIDES, STICKS, UNSOLVABLE };

typedef struct {
  enum contact_state state;
  double force[3];     /* normal, two tangents */
  double direction[2]; /* sliding direction */
} contact_solution_t;

static const contact_solution_t apart = {APART, {0.0, 0.0, 0.0}, {1.0, 0.0}};

/* Acceleration of the gap per normal force, for a contact that slides in the direction (d0, d1). */
static double grip_of(double W[3][3], double mu, double d0, double d1) { return W[0][0] - mu * (W[0][1] * d0 + W[0][2] * d1); }

/* Let a contact slide in the direction (d0, d1) under a normal force. */
static void put_sliding(contact_solution_t* answer, double normal, double mu, double d0, double d1) {
  answer->state = SLIDES;
  answer->force[0] = normal;
  answer->force[1] = -mu * normal * d0;
  answer->force[2] = -mu * normal * d1;
  answer->direction[0] = d0;
  answer->direction[1] = d1;
}

/* What the regularization of a row is a fraction of: the trace, or less for a row of little mobility. */
static double scale_of(double mobility, double trace) {
  return fmin(trace, OWN_PART / LEAST_NORM * (mobility > IMMOBILE * trace ? mobility : trace));
}

/* Force that keeps the point at rest: least-norm solution of W r = -c, where W may be singular. */
static void sticking_force(double W[3][3], const double* c, double* r) {
  const double trace = W[0][0] + W[1][1] + W[2][2];
  for (int i = 0; i < 3; ++i) r[i] = 0.0;
  for (int pass = 0; pass <= REFINEMENTS; ++pass) {
    double damped[9], step[3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) damped[3 * i + j] = W[i][j] + (i == j ? LEAST_NORM * scale_of(W[i][i], trace) : 0.0);
      step[i] = -c[i] - (W[i][0] * r[0] + W[i][1] * r[1] + W[i][2] * r[2]);
    }
    solve_linear(3, damped, step);
    for (int i = 0; i < 3; ++i) r[i] += step[i];
  }
}

/* w_t under the force with which the contact slides in a direction, times the grip. */
static void sliding_motion(double W[3][3], const double* c, double mu, double d0, double d1, double w[2]) {
  const double grip = grip_of(W, mu, d0, d1);
  for (int i = 0; i < 2; ++i) w[i] = grip * c[1 + i] - c[0] * (W[1 + i][0] - mu * (W[1 + i][1] * d0 + W[1 + i][2] * d1));
}

/* The component of sliding_motion perpendicular to the sliding direction. */
static double perpendicular(double W[3][3], const double* c, double mu, double angle) {
  const double d0 = cos(angle), d1 = sin(angle);
  double w[2];
  sliding_motion(W, c, mu, d0, d1, w);
  return d0 * w[1] - d1 * w[0];
}

/* The derivative of `perpendicular` by the angle. */
static double perpendicular_slope(double W[3][3], const double* c, double mu, double angle) {
  const double d0 = cos(angle), d1 = sin(angle), change = mu * (W[0][1] * d1 - W[0][2] * d0);
  double w[2], w_slope[2];
  sliding_motion(W, c, mu, d0, d1, w);
  for (int i = 0; i < 2; ++i) w_slope[i] = change * c[1 + i] - c[0] * mu * (W[1 + i][1] * d1 - W[1 + i][2] * d0);
  return d0 * (w_slope[1] - w[0]) - d1 * (w_slope[0] + w[1]);
}

/* The angle between `low` and `high` at which a function of it changes its sign. */
static double root_of(double (*function)(double W[3][3], const double* c, double mu, double angle), double W[3][3],
                      const double* c, double mu, double low, double high, double f_low) {
  for (int k = 0; k < ROOT_STEPS; ++k) {
    const double middle = 0.5 * (low + high), f = function(W, c, mu, middle);
    if (middle == low || middle == high) break;
    if (f == 0.0) return middle;
    if (f * f_low > 0.0) low = middle;
    else high = middle;
  }
  return 0.5 * (low + high);
}

/* The root in an interval, if there is one: its force if that is a solution. Of several roots, that which dissipates the most
 * is taken: `largest_power` is that of the earlier ones, without the factor mu. */
static void try_interval(double W[3][3], const double* c, double mu, double low, double high, double f_low, double f_high,
                         double* largest_power, contact_solution_t* answer) {
  if (f_low != 0.0 && !(f_low * f_high < 0.0)) return;
  const double root = f_low == 0.0 ? low : root_of(perpendicular, W, c, mu, low, high, f_low);
  const double d0 = cos(root), d1 = sin(root), grip = grip_of(W, mu, d0, d1);
  if (!(grip > 0.0)) return;
  contact_solution_t trial;
  put_sliding(&trial, -c[0] / grip, mu, d0, d1);
  double along = 0.0;
  for (int i = 1; i < 3; ++i) {
    double w = c[i];
    for (int j = 0; j < 3; ++j) w += W[i][j] * trial.force[j];
    along += trial.direction[i - 1] * w;
  }
  if (along * trial.force[0] > *largest_power
      && along >= -BACKWARD_ROUNDING * fmax(fabs(c[0]), fmax(fabs(c[1]), fabs(c[2])))) {
    *largest_power = along * trial.force[0];
    *answer = trial;
  }
}

/* The direction in which the point starts to slide: w_t is along it under the resulting force. */
static void start_to_slide(double W[3][3], const double* c, double mu, contact_solution_t* answer) {
  double largest_power = -INFINITY, angle[DIRECTION_INTERVALS + 1], f[DIRECTION_INTERVALS + 1];
  answer->state = UNSOLVABLE;
  for (int k = 0; k <= DIRECTION_INTERVALS; ++k) {
    angle[k] = FULL_CIRCLE * k / DIRECTION_INTERVALS;
    f[k] = perpendicular(W, c, mu, angle[k]);
    if (k) try_interval(W, c, mu, angle[k - 1], angle[k], f[k - 1], f[k], &largest_power, answer);
  }
  /* Two roots in one interval have an extremum between them. */
  for (int k = 0; k < DIRECTION_INTERVALS && answer->state == UNSOLVABLE; ++k) {
    const double slope = perpendicular_slope(W, c, mu, angle[k]);
    if (!(f[k] * slope < 0.0 && f[k] * perpendicular_slope(W, c, mu, angle[k + 1]) > 0.0)) continue;
    const double middle = root_of(perpendicular_slope, W, c, mu, angle[k], angle[k + 1], slope);
    const double extremum = perpendicular(W, c, mu, middle);
    try_interval(W, c, mu, angle[k], middle, f[k], extremum, &largest_power, answer);
    try_interval(W, c, mu, middle, angle[k + 1], extremum, f[k + 1], &largest_power, answer);
  }
}

/* Solve for one contact, which sticks up to `mu_static`; `along` is the direction of a sliding one, else null. */
static contact_solution_t solve_contact(double W[3][3], const double* c, double mu, double mu_static, const double* along) {
  contact_solution_t answer;
  answer = apart; /* no initializer, of which Clang may make memset: exported code calls none */
  if (c[0] >= 0.0) return answer;
  if (along) {
    const double grip = grip_of(W, mu, along[0], along[1]);
    if (grip > 0.0) put_sliding(&answer, -c[0] / grip, mu, along[0], along[1]);
    else answer.state = UNSOLVABLE;
    return answer;
  }
  double r[3];
  sticking_force(W, c, r);
  if (hypot(r[1], r[2]) <= mu_static * r[0]) {
    answer.state = STICKS;
    for (int i = 0; i < 3; ++i) answer.force[i] = r[i];
    return answer;
  }
  start_to_slide(W, c, mu, &answer);
  return answer;
}
