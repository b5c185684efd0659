/* SPDX-License-Identifier: Apache-2.0
 *
 * Force or impulse of one contact with Coulomb friction: the complementarity problem, solved. The same lines stand in
 * Python in contact_cone.py, with the reasons and sources, for machines without a compiler; a test holds the two together.
 *
 * Before this file: NC (contacts), FRICTION (a brace list), SAMPLES, ROOT_STEPS, DAMPING.
 */

#include <math.h>

#define MC (3 * NC)
/* Entry of a matrix as CasADi writes it, column by column. */
#define AT(matrix, rows, i, j) ((matrix)[(i) + (rows) * (j)])

enum does { APART, SLIDES, STICKS, UNSOLVABLE };

typedef struct {
  enum does does;
  double force[3];     /* normal, two tangents */
  double direction[2]; /* of sliding */
} answer_t;

static const double friction[NC] = FRICTION;

static double grip_of(const double W[3][3], double mu, double d0, double d1) {
  return W[0][0] - mu * (W[0][1] * d0 + W[0][2] * d1);
}

static void put_sliding(answer_t* answer, double normal, double mu, double d0, double d1) {
  answer->does = SLIDES;
  answer->force[0] = normal;
  answer->force[1] = -mu * normal * d0;
  answer->force[2] = -mu * normal * d1;
  answer->direction[0] = d0;
  answer->direction[1] = d1;
}

/* x of A x = b by elimination with row pivots. */
static void solve3(const double A[3][3], const double* b, double* x) {
  double T[3][4];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T[i][j] = A[i][j];
    T[i][3] = b[i];
  }
  for (int k = 0; k < 3; ++k) {
    int pivot = k;
    for (int i = k + 1; i < 3; ++i)
      if (fabs(T[i][k]) > fabs(T[pivot][k])) pivot = i;
    for (int j = k; j < 4; ++j) {
      const double swapped = T[k][j];
      T[k][j] = T[pivot][j];
      T[pivot][j] = swapped;
    }
    for (int i = k + 1; i < 3; ++i) {
      const double factor = T[i][k] / T[k][k];
      for (int j = k; j < 4; ++j) T[i][j] -= factor * T[k][j];
    }
  }
  for (int i = 2; i >= 0; --i) {
    x[i] = T[i][3];
    for (int j = i + 1; j < 3; ++j) x[i] -= T[i][j] * x[j];
    x[i] /= T[i][i];
  }
}

/* Force that keeps the point still: least solution of W r = -c, W perhaps singular. */
static void hold(const double W[3][3], const double* c, double* r) {
  double damped[3][3], residual[3], step[3];
  const double damping = DAMPING * (W[0][0] + W[1][1] + W[2][2]);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) damped[i][j] = W[i][j] + (i == j ? damping : 0.0);
    r[i] = 0.0;
  }
  for (int turn = 0; turn < 3; ++turn) {
    for (int i = 0; i < 3; ++i) residual[i] = -c[i] - (W[i][0] * r[0] + W[i][1] * r[1] + W[i][2] * r[2]);
    solve3(damped, residual, step);
    for (int i = 0; i < 3; ++i) r[i] += step[i];
  }
}

/* Component of w_t across the direction of sliding, times the grip. */
static double across(const double W[3][3], const double* c, double mu, double angle) {
  const double d0 = cos(angle), d1 = sin(angle), grip = grip_of(W, mu, d0, d1);
  const double w1 = grip * c[1] - c[0] * (W[1][0] - mu * (W[1][1] * d0 + W[1][2] * d1));
  const double w2 = grip * c[2] - c[0] * (W[2][0] - mu * (W[2][1] * d0 + W[2][2] * d1));
  return d0 * w2 - d1 * w1;
}

static double root_of(const double W[3][3], const double* c, double mu, double low, double high, double f_low) {
  for (int k = 0; k < ROOT_STEPS; ++k) {
    const double middle = 0.5 * (low + high), f = across(W, c, mu, middle);
    if (middle == low || middle == high) break;
    if (f == 0.0) return middle;
    if (f * f_low > 0.0) low = middle;
    else high = middle;
  }
  return 0.5 * (low + high);
}

/* The direction in which the point starts: w_t along it under the force that it means. */
static void start_to_slide(const double W[3][3], const double* c, double mu, answer_t* answer) {
  const double full_turn = 6.283185307179586;
  const double largest = fmax(fabs(c[0]), fmax(fabs(c[1]), fabs(c[2])));
  double best = -INFINITY, value = across(W, c, mu, 0.0);
  answer->does = UNSOLVABLE;
  for (int k = 0; k < SAMPLES; ++k) {
    const double angle = full_turn * k / SAMPLES, next_angle = full_turn * (k + 1) / SAMPLES;
    const double next = across(W, c, mu, next_angle), f = value;
    value = next;
    if (f != 0.0 && !(f * next < 0.0)) continue;
    const double root = f == 0.0 ? angle : root_of(W, c, mu, angle, next_angle, f);
    const double d0 = cos(root), d1 = sin(root), grip = grip_of(W, mu, d0, d1);
    if (!(grip > 0.0)) continue;
    answer_t trial;
    put_sliding(&trial, -c[0] / grip, mu, d0, d1);
    double along = 0.0;
    for (int i = 1; i < 3; ++i) {
      double w = c[i];
      for (int j = 0; j < 3; ++j) w += W[i][j] * trial.force[j];
      along += trial.direction[i - 1] * w;
    }
    if (along * trial.force[0] > best && along >= -1e-12 * largest) {
      best = along * trial.force[0];
      *answer = trial;
    }
  }
}

/* Solve for one contact; `given` is the direction of one that slides already, else null. */
static answer_t single(const double W[3][3], const double* c, double mu, const double* given) {
  answer_t answer = {APART, {0.0, 0.0, 0.0}, {1.0, 0.0}};
  if (given) {
    answer.direction[0] = given[0];
    answer.direction[1] = given[1];
  }
  if (c[0] >= 0.0) return answer;
  if (given) {
    const double grip = grip_of(W, mu, given[0], given[1]);
    if (grip > 0.0) put_sliding(&answer, -c[0] / grip, mu, given[0], given[1]);
    else answer.does = UNSOLVABLE;
    return answer;
  }
  double held[3];
  hold(W, c, held);
  if (hypot(held[1], held[2]) <= mu * held[0]) {
    answer.does = STICKS;
    for (int i = 0; i < 3; ++i) answer.force[i] = held[i];
    return answer;
  }
  start_to_slide(W, c, mu, &answer);
  return answer;
}
