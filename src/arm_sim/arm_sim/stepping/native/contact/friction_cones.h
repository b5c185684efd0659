/* SPDX-License-Identifier: Apache-2.0
 *
 * Solution of the complementarity problem of forces or impulses of NC contacts with Coulomb friction.
 *
 * The unknowns are contact forces r, three numbers each (normal, two tangents), and motions w = W r + c with
 *
 *     0 <= r_n, 0 <= w_n, r_n w_n = 0,   |r_t| <= mu r_n,   r_t = -mu r_n w_t / |w_t| where w_t != 0.
 *
 * The same problem applies to accelerations and to velocities after an impact (Moreau, "Unilateral contact and dry
 * friction in finite freedom dynamics", CISM 302, 1988). The cone is Coulomb's, not a pyramid: the direction in which a
 * contact starts to slide is the root of a trigonometric polynomial (Bonnefon, Daviet, "Quartic formulation of Coulomb 3D
 * frictional contact", INRIA, 2011). Several contacts are solved one after another until nothing changes (Jourdan, Alart,
 * Jean, "A Gauss-Seidel like algorithm to solve frictional contact problems", Comput. Methods Appl. Mech. Eng. 155, 1998),
 * and where that converges slowly, all together by Newton's method, with t = r_n - rho w_n and z = r_t - rho w_t, on
 *
 *     r_n = max(0, t),   r_t = z, or if |z| > mu t the vector of length mu t along z
 *
 * (Alart, Curnier, "A mixed formulation for frictional contact problems prone to Newton like solution methods", Comput.
 * Methods Appl. Mech. Eng. 92, 1991).
 */

#pragma once
#include "scene.h"

#include <math.h>

/* Entry of a matrix in CasADi's column-major order. */
#define AT(matrix, rows, i, j) ((matrix)[(i) + (rows) * (j)])

#define SAMPLES 32       /* intervals of directions in which a contact may start to slide */
#define ROOT_STEPS 100   /* bisections to find the direction */
#define LEAST_NORM 1e-8  /* fraction of the trace that regularizes a singular W; two refinements remove its effect ... */
#define OWN_PART 1e-5    /* ... but of a row, not more than this fraction of its own mobility, which they remove as well */
#define IMMOBILE 1e-20   /* fraction of the trace up to which a row cannot move */
#define SETTLED 1e-15    /* change of the forces at which sweeps end, relative to the contact's own */
#define FORCE_STEPS 60
#define STEP_HALVINGS 12
#define SOLVED 1e-15     /* residual of Newton's equations, relative to the contact's own forces, ... */
#define ROUNDED 1e-10    /* ... the same where rounding prevents that, ... */
#define REGULAR 1e-12    /* ... and multiple of the rows' scales that keeps them regular */
#define CONTINUED 20     /* continuation steps in which friction grows from zero, as the last resort */

/* State of a contact. Python: ContactState. */
enum contact_state { APART, SLIDES, STICKS, UNSOLVABLE };

typedef struct {
  enum contact_state state;
  double force[3];     /* normal, two tangents */
  double direction[2]; /* sliding direction */
} answer_t;

static const answer_t apart = {APART, {0.0, 0.0, 0.0}, {1.0, 0.0}};

static double grip_of(double W[3][3], double mu, double d0, double d1) { return W[0][0] - mu * (W[0][1] * d0 + W[0][2] * d1); }

static void put_sliding(answer_t* answer, double normal, double mu, double d0, double d1) {
  answer->state = SLIDES;
  answer->force[0] = normal;
  answer->force[1] = -mu * normal * d0;
  answer->force[2] = -mu * normal * d1;
  answer->direction[0] = d0;
  answer->direction[1] = d1;
}

/* Solve A x = b for a row-major n by n matrix, both overwritten, by elimination with row pivots: 0 if A is singular. */
static int solve_linear(int n, double* A, double* b) {
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (fabs(A[n * i + k]) > fabs(A[n * pivot + k])) pivot = i;
    if (A[n * pivot + k] == 0.0) return 0;
    for (int j = k; j < n; ++j) {
      const double swapped = A[n * k + j];
      A[n * k + j] = A[n * pivot + j];
      A[n * pivot + j] = swapped;
    }
    const double swapped = b[k];
    b[k] = b[pivot];
    b[pivot] = swapped;
    for (int i = k + 1; i < n; ++i) {
      const double factor = A[n * i + k] / A[n * k + k];
      for (int j = k; j < n; ++j) A[n * i + j] -= factor * A[n * k + j];
      b[i] -= factor * b[k];
    }
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int j = i + 1; j < n; ++j) b[i] -= A[n * i + j] * b[j];
    b[i] /= A[n * i + i];
  }
  return 1;
}

/* What the regularization of a row is a fraction of: the trace, or less for a row of little mobility. */
static double scale_of(double mobility, double trace) {
  return fmin(trace, OWN_PART / LEAST_NORM * (mobility > IMMOBILE * trace ? mobility : trace));
}

/* Force that keeps the point at rest: least-norm solution of W r = -c, where W may be singular. */
static void sticking_force(double W[3][3], const double* c, double* r) {
  const double trace = W[0][0] + W[1][1] + W[2][2];
  for (int i = 0; i < 3; ++i) r[i] = 0.0;
  for (int turn = 0; turn < 3; ++turn) {
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

/* Its component perpendicular to the sliding direction. */
static double perpendicular(double W[3][3], const double* c, double mu, double angle) {
  const double d0 = cos(angle), d1 = sin(angle);
  double w[2];
  sliding_motion(W, c, mu, d0, d1, w);
  return d0 * w[1] - d1 * w[0];
}

/* The derivative of that by the angle. */
static double perpendicular_slope(double W[3][3], const double* c, double mu, double angle) {
  const double d0 = cos(angle), d1 = sin(angle), change = mu * (W[0][1] * d1 - W[0][2] * d0);
  double w[2], turned[2];
  sliding_motion(W, c, mu, d0, d1, w);
  for (int i = 0; i < 2; ++i) turned[i] = change * c[1 + i] - c[0] * mu * (W[1 + i][1] * d1 - W[1 + i][2] * d0);
  return d0 * (turned[1] - w[0]) - d1 * (turned[0] + w[1]);
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

/* The root in an interval, if there is one: its force if that is a solution, and the best so far. */
static void try_interval(double W[3][3], const double* c, double mu, double low, double high, double f_low, double f_high,
                         double* best, answer_t* answer) {
  if (f_low != 0.0 && !(f_low * f_high < 0.0)) return;
  const double root = f_low == 0.0 ? low : root_of(perpendicular, W, c, mu, low, high, f_low);
  const double d0 = cos(root), d1 = sin(root), grip = grip_of(W, mu, d0, d1);
  if (!(grip > 0.0)) return;
  answer_t trial;
  put_sliding(&trial, -c[0] / grip, mu, d0, d1);
  double along = 0.0;
  for (int i = 1; i < 3; ++i) {
    double w = c[i];
    for (int j = 0; j < 3; ++j) w += W[i][j] * trial.force[j];
    along += trial.direction[i - 1] * w;
  }
  if (along * trial.force[0] > *best && along >= -1e-12 * fmax(fabs(c[0]), fmax(fabs(c[1]), fabs(c[2])))) {
    *best = along * trial.force[0];
    *answer = trial;
  }
}

/* The direction in which the point starts to slide: w_t is along it under the resulting force. */
static void start_to_slide(double W[3][3], const double* c, double mu, answer_t* answer) {
  double best = -INFINITY, angle[SAMPLES + 1], f[SAMPLES + 1];
  answer->state = UNSOLVABLE;
  for (int k = 0; k <= SAMPLES; ++k) {
    angle[k] = 6.283185307179586 * k / SAMPLES;
    f[k] = perpendicular(W, c, mu, angle[k]);
    if (k) try_interval(W, c, mu, angle[k - 1], angle[k], f[k - 1], f[k], &best, answer);
  }
  /* Two roots in one interval have an extremum between them. */
  for (int k = 0; k < SAMPLES && answer->state == UNSOLVABLE; ++k) {
    const double slope = perpendicular_slope(W, c, mu, angle[k]);
    if (!(f[k] * slope < 0.0 && f[k] * perpendicular_slope(W, c, mu, angle[k + 1]) > 0.0)) continue;
    const double middle = root_of(perpendicular_slope, W, c, mu, angle[k], angle[k + 1], slope);
    const double extremum = perpendicular(W, c, mu, middle);
    try_interval(W, c, mu, angle[k], middle, f[k], extremum, &best, answer);
    try_interval(W, c, mu, middle, angle[k + 1], extremum, f[k + 1], &best, answer);
  }
}

/* Solve for one contact, which sticks up to `held`; `given` is the direction of a sliding one, else null. */
static answer_t solve_contact(double W[3][3], const double* c, double mu, double held, const double* given) {
  answer_t answer;
  answer = apart; /* as an initializer it may become memset in C++ */
  if (c[0] >= 0.0) return answer;
  if (given) {
    const double grip = grip_of(W, mu, given[0], given[1]);
    if (grip > 0.0) put_sliding(&answer, -c[0] / grip, mu, given[0], given[1]);
    else answer.state = UNSOLVABLE;
    return answer;
  }
  double r[3];
  sticking_force(W, c, r);
  if (hypot(r[1], r[2]) <= held * r[0]) {
    answer.state = STICKS;
    for (int i = 0; i < 3; ++i) answer.force[i] = r[i];
    return answer;
  }
  start_to_slide(W, c, mu, &answer);
  return answer;
}

/* The problem of all contacts. */
typedef struct {
  const double *W, *c; /* motion per force, and motion without forces */
  const double *friction, *holding; /* coefficients of sliding and static friction ... */
  double *mu, *held;                /* ... and the fraction of them in the current continuation step */
  double* given;   /* direction of a sliding contact, two numbers each, ... */
  double* slides;  /* ... and whether it slides */
  double* allowed; /* whether a contact may transmit a force */
} cones_t;
#define CONES (6 * NC)

static cones_t cones_of(const scene_t* scene, double* numbers) {
  cones_t cones = {0, 0, 0, 0, numbers, numbers + NC, numbers + 2 * NC, numbers + 4 * NC, numbers + 5 * NC};
  return cones;
}

/* The contact's own part of W. */
static void own_block(const scene_t* scene, const double* W, int k, double block[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) block[i][j] = AT(W, MC, 3 * k + i, 3 * k + j);
}

static double own_trace(const scene_t* scene, const double* W, int k) {
  return AT(W, MC, 3 * k, 3 * k) + AT(W, MC, 3 * k + 1, 3 * k + 1) + AT(W, MC, 3 * k + 2, 3 * k + 2);
}

/* Size of the forces of one contact: of its own, and of those that its motion without them demands. */
static double own_size(const scene_t* scene, const cones_t* cones, const double* r, int k) {
  double size = 0.0;
  for (int i = 3 * k; i < 3 * k + 3; ++i) {
    double demand = fabs(cones->c[i]);
    for (int j = 0; j < MC; ++j) demand += fabs(AT(cones->W, MC, i, j) * r[j]);
    size = fmax(size, fmax(fabs(r[i]), demand / own_trace(scene, cones->W, k)));
  }
  return size;
}

/* Solve one contact after another (Gauss-Seidel): 1 if this converges. */
static int sweep(const scene_t* scene, const cones_t* cones, double* r, int sweeps, answer_t* answers) {
  double block[3][3], change[NC + 1];
  for (int k = 0; k < NC; ++k) answers[k] = apart;
  for (int turn = 0; turn < sweeps; ++turn) {
    int settled = 1;
    for (int k = 0; k < NC; ++k) {
      change[k] = 0.0;
      if (cones->allowed[k] == 0.0) continue;
      double others[3];
      own_block(scene, cones->W, k, block);
      for (int i = 0; i < 3; ++i) {
        others[i] = cones->c[3 * k + i];
        for (int j = 0; j < MC; ++j)
          if (j / 3 != k) others[i] += AT(cones->W, MC, 3 * k + i, j) * r[j];
      }
      answers[k] =
          solve_contact(block, others, cones->mu[k], cones->held[k], cones->slides[k] != 0.0 ? cones->given + 2 * k : 0);
      for (int i = 0; i < 3; ++i) {
        change[k] = fmax(change[k], fabs(answers[k].force[i] - r[3 * k + i]));
        r[3 * k + i] = answers[k].force[i];
      }
    }
    for (int k = 0; k < NC; ++k) {
      settled &= change[k] == 0.0 || change[k] <= SETTLED * own_size(scene, cones, r, k);
      settled &= answers[k].state != UNSOLVABLE || cones->slides[k] != 0.0; /* what starts to slide has a solution */
    }
    if (settled) return 1;
  }
  return 0;
}

static void find_motion(const scene_t* scene, const cones_t* cones, const double* r, double* w) {
  for (int i = 0; i < MC; ++i) {
    w[i] = cones->c[i];
    for (int j = 0; j < MC; ++j) w[i] += AT(cones->W, MC, i, j) * r[j];
  }
}

/* Tangential rows of a contact that starts to slide, or slides in an unknown direction. */
static void turning_rows(const scene_t* scene, const cones_t* cones, int k, double rho, double pressed, const double* z,
                         double size, const double* regular, double* J) {
  const double mu = cones->mu[k], along[2] = {z[0] / size, z[1] / size}, part = mu * pressed / size;
  for (int j = 0; j < MC; ++j) {
    double pressing = -rho * AT(cones->W, MC, 3 * k, j), moving[2];
    if (j == 3 * k) pressing += 1.0 - rho * regular[j];
    for (int i = 0; i < 2; ++i) {
      moving[i] = -rho * AT(cones->W, MC, 3 * k + 1 + i, j);
      if (j == 3 * k + 1 + i) moving[i] += 1.0 - rho * regular[j];
    }
    const double ahead = along[0] * moving[0] + along[1] * moving[1];
    for (int i = 0; i < 2; ++i)
      J[MC * (3 * k + 1 + i) + j] -= mu * along[i] * pressing + part * (moving[i] - along[i] * ahead);
  }
}

/* Residual of Coulomb's law as equations in the forces, and its derivative; returns the sum of squares of the residual, as
 * the accelerations that it would cause. */
static double equations(const scene_t* scene, const cones_t* cones, const double* r, double* F, double* J) {
  double w[MC + 1], regular[MC + 1], trace = 0.0, sum = 0.0;
  find_motion(scene, cones, r, w);
  for (int i = 0; i < MC; ++i) {
    F[i] = r[i];
    trace += AT(cones->W, MC, i, i);
    for (int j = 0; j < MC; ++j) J[MC * i + j] = i == j;
  }
  for (int i = 0; i < MC; ++i) regular[i] = REGULAR * scale_of(AT(cones->W, MC, i, i), trace);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    if (cones->allowed[k] == 0.0) continue;
    const double rho = 3.0 / own_trace(scene, cones->W, k), mu = cones->mu[k], pressed = r[n] - rho * w[n];
    if (pressed <= 0.0) continue;
    const double z[2] = {r[n + 1] - rho * w[n + 1], r[n + 2] - rho * w[n + 2]}, size = hypot(z[0], z[1]);
    const int holds = cones->slides[k] == 0.0 && size <= cones->held[k] * pressed;
    for (int i = n; i < (holds ? n + 3 : n + 1); ++i) {
      F[i] = rho * w[i];
      for (int j = 0; j < MC; ++j) J[MC * i + j] = rho * (AT(cones->W, MC, i, j) + (i == j ? regular[i] : 0.0));
    }
    for (int i = 0; i < 2 && !holds; ++i) {
      if (cones->slides[k] != 0.0) {
        F[n + 1 + i] = r[n + 1 + i] + mu * r[n] * cones->given[2 * k + i];
        J[MC * (n + 1 + i) + n] = mu * cones->given[2 * k + i];
      } else {
        F[n + 1 + i] = r[n + 1 + i] - mu * pressed * z[i] / size;
      }
    }
    if (!holds && cones->slides[k] == 0.0) turning_rows(scene, cones, k, rho, pressed, z, size, regular, J);
  }
  for (int i = 0; i < MC; ++i) {
    const double caused = F[i] * own_trace(scene, cones->W, i / 3);
    sum += caused * caused;
  }
  return sum;
}

static void read_answers(const scene_t* scene, const cones_t* cones, const double* r, answer_t* answers) {
  double w[MC + 1];
  find_motion(scene, cones, r, w);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    const double rho = cones->allowed[k] != 0.0 ? 3.0 / own_trace(scene, cones->W, k) : 0.0, pressed = r[n] - rho * w[n];
    const double z[2] = {r[n + 1] - rho * w[n + 1], r[n + 2] - rho * w[n + 2]}, size = hypot(z[0], z[1]);
    answers[k] = apart;
    if (cones->allowed[k] == 0.0 || pressed <= 0.0) continue;
    for (int i = 0; i < 3; ++i) answers[k].force[i] = r[n + i];
    answers[k].state = cones->slides[k] == 0.0 && size <= cones->held[k] * pressed ? STICKS : SLIDES;
    for (int i = 0; i < 2 && answers[k].state == SLIDES; ++i)
      answers[k].direction[i] = cones->slides[k] != 0.0 ? cones->given[2 * k + i] : -z[i] / size;
  }
}

/* Largest residual of the laws, relative to the forces of its contact. */
static double relative_residual(const scene_t* scene, const cones_t* cones, const double* r, const double* F) {
  double most = 0.0;
  for (int k = 0; k < NC; ++k) {
    const double left = fmax(fabs(F[3 * k]), fmax(fabs(F[3 * k + 1]), fabs(F[3 * k + 2])));
    if (left != 0.0) most = fmax(most, left / (own_size(scene, cones, r, k) + 1e-300));
  }
  return most;
}

/* Improve forces by Newton's method until they satisfy the laws, to rounding: 0 if they do not. */
static int newton(const scene_t* scene, const cones_t* cones, double* r, answer_t* answers) {
  double trial[MC + 1], after[MC + 1], F[MC + 1], J[MC * MC + 1], step[MC + 1], left;
  for (int i = 0; i < MC; ++i) trial[i] = r[i];
  double size = equations(scene, cones, trial, F, J);
  for (int turn = 0, better = 1;; ++turn) {
    double length = 1.0, next = size;
    left = relative_residual(scene, cones, trial, F);
    if (left <= (better ? SOLVED : ROUNDED) || turn == FORCE_STEPS) break;
    for (int i = 0; i < MC; ++i) step[i] = -F[i];
    if (!solve_linear(MC, J, step)) break;
    better = 0;
    for (int k = 0; k < STEP_HALVINGS && !better; ++k) {
      for (int i = 0; i < MC; ++i) after[i] = trial[i] + length * step[i];
      next = equations(scene, cones, after, F, J);
      better = next < (1.0 - 1e-4 * length) * size;
      length *= 0.5;
    }
    for (int i = 0; i < MC; ++i) trial[i] = after[i];
    size = next;
  }
  if (!(left <= ROUNDED)) return 0;
  for (int i = 0; i < MC; ++i) r[i] = trial[i];
  read_answers(scene, cones, r, answers);
  return 1;
}

static void scale_friction(const scene_t* scene, cones_t* cones, double part) {
  for (int k = 0; k < NC; ++k) {
    cones->mu[k] = cones->friction[k] * part;
    cones->held[k] = cones->holding[k] * part;
  }
}

/* Solve for several contacts: 0 if no solution is found. */
static int solve_contacts(const scene_t* scene, cones_t* cones, answer_t* answers) {
  static const int sweeps[2] = {20, 200}; /* sweeps before Newton's method is tried, and tried again */
  double r[MC + 1];
  int found = 0;
  for (int i = 0; i < MC; ++i) r[i] = 0.0;
  scale_friction(scene, cones, 1.0);
  for (int k = 0; k < 2; ++k)
    if (sweep(scene, cones, r, sweeps[k], answers) || newton(scene, cones, r, answers)) return 1;
  for (int i = 0; i < MC; ++i) r[i] = 0.0;
  for (int part = 0; part <= CONTINUED; ++part) {
    scale_friction(scene, cones, (double)part / CONTINUED);
    found = sweep(scene, cones, r, sweeps[0], answers) || newton(scene, cones, r, answers);
  }
  return found;
}
