/* SPDX-License-Identifier: Apache-2.0
 *
 * Contacts solved all together by Newton's method, with t = r_n - rho w_n and z = r_t - rho w_t, on
 *
 *     r_n = max(0, t),   r_t = z, or if |z| > mu t the vector of length mu t along z
 *
 * (Alart, Curnier, "A mixed formulation for frictional contact problems prone to Newton like solution methods", Comput.
 * Methods Appl. Mech. Eng. 92, 1991).
 */

#pragma once
#include "contact/contact_problem.h"
#include "contact/one_contact.h"

#define NEWTON_STEPS 60
#define STEP_HALVINGS 12
#define SUFFICIENT_DECREASE 1e-4 /* of the sum of squares, relative to a step's length (Armijo) */
#define NEWTON_TOLERANCE 1e-15   /* residual of Newton's equations, relative to the contact's own forces */
#define ROUNDING_TOLERANCE 1e-10 /* residual that is accepted where rounding prevents a smaller one */
#define REGULARIZATION 1e-12     /* multiple of the rows' scales that keeps Newton's equations regular */

/* Motions w = W r + c of all contacts. */
static void find_motion(const scene_t* scene, const cones_t* cones, const double* r, double* w) {
  for (int i = 0; i < MC; ++i) {
    w[i] = cones->c[i];
    for (int j = 0; j < MC; ++j) w[i] += AT(cones->W, MC, i, j) * r[j];
  }
}

/* rho, t, z and |z| of a contact at forces r and motions w, and whether it sticks. */
typedef struct {
  double rho, t, z[2], magnitude;
  int sticks;
} projection_t;

/* rho is the reciprocal of the mean diagonal of the contact's own part of W: forces and motions then have the same weight. */
static projection_t project_contact(const scene_t* scene, const cones_t* cones, const double* r, const double* w, int k) {
  const double rho = 3.0 / own_trace(scene, cones->W, k), *force = r + 3 * k, *motion = w + 3 * k;
  projection_t at = {rho, force[0] - rho * motion[0], {force[1] - rho * motion[1], force[2] - rho * motion[2]}, 0.0, 0};
  at.magnitude = hypot(at.z[0], at.z[1]);
  at.sticks = cones->was_sliding[k] == 0.0 && at.magnitude <= cones->mu_static[k] * at.t;
  return at;
}

/* Tangential rows of a contact that starts to slide, or slides in an unknown direction. */
static void turning_rows(const scene_t* scene, const cones_t* cones, int k, const projection_t* at, const double* regular,
                         double* J) {
  const double mu = cones->mu[k], rho = at->rho, part = mu * at->t / at->magnitude;
  const double along[2] = {at->z[0] / at->magnitude, at->z[1] / at->magnitude};
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

/* Residual F of Coulomb's law as equations in the forces, and its derivative J, row by row; returns the sum of squares of the
 * residual, as the accelerations that it would cause. */
static double equations(const scene_t* scene, const cones_t* cones, const double* r, double* F, double* J) {
  double w[MC + 1], regular[MC + 1], trace = 0.0, merit = 0.0;
  find_motion(scene, cones, r, w);
  for (int i = 0; i < MC; ++i) {
    F[i] = r[i];
    trace += AT(cones->W, MC, i, i);
    for (int j = 0; j < MC; ++j) J[MC * i + j] = i == j;
  }
  for (int i = 0; i < MC; ++i) regular[i] = REGULARIZATION * scale_of(AT(cones->W, MC, i, i), trace);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    if (cones->is_touching[k] == 0.0) continue;
    const projection_t at = project_contact(scene, cones, r, w, k);
    if (at.t <= 0.0) continue;
    for (int i = n; i < (at.sticks ? n + 3 : n + 1); ++i) {
      F[i] = at.rho * w[i];
      for (int j = 0; j < MC; ++j) J[MC * i + j] = at.rho * (AT(cones->W, MC, i, j) + (i == j ? regular[i] : 0.0));
    }
    for (int i = 0; i < 2 && !at.sticks; ++i) {
      if (cones->was_sliding[k] != 0.0) {
        F[n + 1 + i] = r[n + 1 + i] + cones->mu[k] * r[n] * cones->sliding_direction[2 * k + i];
        J[MC * (n + 1 + i) + n] = cones->mu[k] * cones->sliding_direction[2 * k + i];
      } else F[n + 1 + i] = r[n + 1 + i] - cones->mu[k] * at.t * at.z[i] / at.magnitude;
    }
    if (!at.sticks && cones->was_sliding[k] == 0.0) turning_rows(scene, cones, k, &at, regular, J);
  }
  for (int i = 0; i < MC; ++i) {
    const double acceleration = F[i] * own_trace(scene, cones->W, i / 3);
    merit += acceleration * acceleration;
  }
  return merit;
}

/* States of the contacts and their sliding directions, from forces that satisfy the laws. */
static void read_answers(const scene_t* scene, const cones_t* cones, const double* r, contact_solution_t* answers) {
  double w[MC + 1];
  find_motion(scene, cones, r, w);
  for (int k = 0; k < NC; ++k) {
    answers[k] = apart;
    if (cones->is_touching[k] == 0.0) continue;
    const projection_t at = project_contact(scene, cones, r, w, k);
    if (at.t <= 0.0) continue;
    for (int i = 0; i < 3; ++i) answers[k].force[i] = r[3 * k + i];
    answers[k].state = at.sticks ? STICKS : SLIDES;
    for (int i = 0; i < 2 && answers[k].state == SLIDES; ++i)
      answers[k].direction[i] = cones->was_sliding[k] != 0.0 ? cones->sliding_direction[2 * k + i] : -at.z[i] / at.magnitude;
  }
}

/* Largest residual of the laws, relative to the forces of its contact. */
static double relative_residual(const scene_t* scene, const cones_t* cones, const double* r, const double* F) {
  double largest = 0.0;
  for (int k = 0; k < NC; ++k) {
    const double residual = fmax(fabs(F[3 * k]), fmax(fabs(F[3 * k + 1]), fabs(F[3 * k + 2])));
    if (residual != 0.0) largest = fmax(largest, residual / (own_size(scene, cones, r, k) + 1e-300));
  }
  return largest;
}

/* Improve forces by Newton's method until they satisfy the laws, to rounding: 0 if they do not. */
static int newton(const scene_t* scene, const cones_t* cones, double* r, contact_solution_t* answers) {
  double trial[MC + 1], after[MC + 1], F[MC + 1], J[MC * MC + 1], step[MC + 1], residual;
  for (int i = 0; i < MC; ++i) trial[i] = r[i];
  double merit = equations(scene, cones, trial, F, J);
  for (int iteration = 0, has_decreased = 1;; ++iteration) {
    double length = 1.0, next_merit = merit;
    residual = relative_residual(scene, cones, trial, F);
    /* After a search without decrease only rounding is left, and ROUNDING_TOLERANCE is accepted. The last step of the search
     * is taken even so. */
    if (residual <= (has_decreased ? NEWTON_TOLERANCE : ROUNDING_TOLERANCE) || iteration == NEWTON_STEPS) break;
    for (int i = 0; i < MC; ++i) step[i] = -F[i];
    if (!solve_linear(MC, J, step)) break;
    has_decreased = 0;
    for (int k = 0; k < STEP_HALVINGS && !has_decreased; ++k) {
      for (int i = 0; i < MC; ++i) after[i] = trial[i] + length * step[i];
      next_merit = equations(scene, cones, after, F, J);
      has_decreased = next_merit < (1.0 - SUFFICIENT_DECREASE * length) * merit;
      length *= 0.5;
    }
    for (int i = 0; i < MC; ++i) trial[i] = after[i];
    merit = next_merit;
  }
  if (!(residual <= ROUNDING_TOLERANCE)) return 0;
  for (int i = 0; i < MC; ++i) r[i] = trial[i];
  read_answers(scene, cones, r, answers);
  return 1;
}
