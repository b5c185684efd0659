/* SPDX-License-Identifier: Apache-2.0
 *
 * Forces or impulses of several contacts with Coulomb friction. The same lines stand in Python in contact_cone.py and
 * contact_newton.py, with the reasons and sources, for machines without a compiler; a test holds the two together.
 *
 * Before this file: cone.c; SWEEPS, MORE_SWEEPS, CONTINUED, SETTLED, STEPS, HALVED, SOLVED, REGULAR.
 */

typedef struct {
  const double *W, *c; /* motion per force, and without */
  double mu[NC];
  double given[NC][2]; /* direction of one that slides already ... */
  int slides[NC];      /* ... where it does */
  int allowed[NC];     /* whether a contact may carry at all */
} cones_t;

/* The contact's own part of W. */
static void own_block(const double* W, int k, double block[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) block[i][j] = AT(W, MC, 3 * k + i, 3 * k + j);
}

/* Solve one contact after the other: 1 if they settle. */
static int sweep(const cones_t* cones, double* r, int sweeps, answer_t* answers) {
  double block[3][3];
  for (int k = 0; k < NC; ++k) answers[k] = (answer_t){APART, {0.0, 0.0, 0.0}, {1.0, 0.0}};
  for (int turn = 0; turn < sweeps; ++turn) {
    double change = 0.0, largest = 0.0;
    for (int k = 0; k < NC; ++k) {
      if (!cones->allowed[k]) continue;
      double others[3];
      own_block(cones->W, k, block);
      for (int i = 0; i < 3; ++i) {
        others[i] = cones->c[3 * k + i];
        for (int j = 0; j < MC; ++j)
          if (j / 3 != k) others[i] += AT(cones->W, MC, 3 * k + i, j) * r[j];
      }
      answers[k] = single(block, others, cones->mu[k], cones->slides[k] ? cones->given[k] : 0);
      for (int i = 0; i < 3; ++i) {
        change = fmax(change, fabs(answers[k].force[i] - r[3 * k + i]));
        r[3 * k + i] = answers[k].force[i];
      }
    }
    for (int i = 0; i < MC; ++i) largest = fmax(largest, fabs(r[i]));
    if (change <= SETTLED * largest) return 1;
  }
  return 0;
}

/* x of A x = b, both overwritten, by elimination with row pivots: 0 if A is singular. */
static int solve_dense(double A[MC][MC], double* b) {
  for (int k = 0; k < MC; ++k) {
    int pivot = k;
    for (int i = k + 1; i < MC; ++i)
      if (fabs(A[i][k]) > fabs(A[pivot][k])) pivot = i;
    if (A[pivot][k] == 0.0) return 0;
    for (int j = 0; j < MC; ++j) {
      const double swapped = A[k][j];
      A[k][j] = A[pivot][j];
      A[pivot][j] = swapped;
    }
    const double swapped = b[k];
    b[k] = b[pivot];
    b[pivot] = swapped;
    for (int i = k + 1; i < MC; ++i) {
      const double factor = A[i][k] / A[k][k];
      for (int j = k; j < MC; ++j) A[i][j] -= factor * A[k][j];
      b[i] -= factor * b[k];
    }
  }
  for (int i = MC - 1; i >= 0; --i) {
    for (int j = i + 1; j < MC; ++j) b[i] -= A[i][j] * b[j];
    b[i] /= A[i][i];
  }
  return 1;
}

static double own_trace(const double* W, int k) {
  return AT(W, MC, 3 * k, 3 * k) + AT(W, MC, 3 * k + 1, 3 * k + 1) + AT(W, MC, 3 * k + 2, 3 * k + 2);
}

static void find_motion(const cones_t* cones, const double* r, double* w) {
  for (int i = 0; i < MC; ++i) {
    w[i] = cones->c[i];
    for (int j = 0; j < MC; ++j) w[i] += AT(cones->W, MC, i, j) * r[j];
  }
}

/* Tangential rows of a contact that starts to slide or slides in a direction that is not known. */
static void turning_rows(const cones_t* cones, int k, double rho, double pressed, const double* z, double size,
                         double regular, double J[MC][MC]) {
  const double mu = cones->mu[k], along[2] = {z[0] / size, z[1] / size}, part = mu * pressed / size;
  for (int j = 0; j < MC; ++j) {
    double pressing = -rho * AT(cones->W, MC, 3 * k, j), moving[2];
    if (j == 3 * k) pressing += 1.0 - rho * regular;
    for (int i = 0; i < 2; ++i) {
      moving[i] = -rho * AT(cones->W, MC, 3 * k + 1 + i, j);
      if (j == 3 * k + 1 + i) moving[i] += 1.0 - rho * regular;
    }
    const double ahead = along[0] * moving[0] + along[1] * moving[1];
    for (int i = 0; i < 2; ++i)
      J[3 * k + 1 + i][j] -= mu * along[i] * pressing + part * (moving[i] - along[i] * ahead);
  }
}

/* What is left of Coulomb's law as equations, in forces, and its derivative; the sum of squares of what is left. */
static double equations(const cones_t* cones, const double* r, double* F, double J[MC][MC]) {
  double w[MC], trace = 0.0, sum = 0.0;
  find_motion(cones, r, w);
  for (int i = 0; i < MC; ++i) {
    F[i] = r[i];
    trace += AT(cones->W, MC, i, i);
    for (int j = 0; j < MC; ++j) J[i][j] = i == j;
  }
  const double regular = REGULAR * trace;
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    if (!cones->allowed[k]) continue;
    const double rho = 3.0 / own_trace(cones->W, k), mu = cones->mu[k], pressed = r[n] - rho * w[n];
    if (pressed <= 0.0) continue;
    const double z[2] = {r[n + 1] - rho * w[n + 1], r[n + 2] - rho * w[n + 2]}, size = hypot(z[0], z[1]);
    const int holds = !cones->slides[k] && size <= mu * pressed;
    for (int i = n; i < (holds ? n + 3 : n + 1); ++i) {
      F[i] = rho * w[i];
      for (int j = 0; j < MC; ++j) J[i][j] = rho * (AT(cones->W, MC, i, j) + (i == j ? regular : 0.0));
    }
    for (int i = 0; i < 2 && !holds; ++i) {
      if (cones->slides[k]) {
        F[n + 1 + i] = r[n + 1 + i] + mu * r[n] * cones->given[k][i];
        J[n + 1 + i][n] = mu * cones->given[k][i];
      } else {
        F[n + 1 + i] = r[n + 1 + i] - mu * pressed * z[i] / size;
      }
    }
    if (!holds && !cones->slides[k]) turning_rows(cones, k, rho, pressed, z, size, regular, J);
  }
  for (int i = 0; i < MC; ++i) sum += F[i] * F[i];
  return sum;
}

static void read_answers(const cones_t* cones, const double* r, answer_t* answers) {
  double w[MC];
  find_motion(cones, r, w);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    const double rho = cones->allowed[k] ? 3.0 / own_trace(cones->W, k) : 0.0, pressed = r[n] - rho * w[n];
    const double z[2] = {r[n + 1] - rho * w[n + 1], r[n + 2] - rho * w[n + 2]}, size = hypot(z[0], z[1]);
    answers[k] = (answer_t){APART, {0.0, 0.0, 0.0}, {1.0, 0.0}};
    for (int i = 0; i < 2 && cones->slides[k]; ++i) answers[k].direction[i] = cones->given[k][i];
    if (!cones->allowed[k] || pressed <= 0.0) continue;
    for (int i = 0; i < 3; ++i) answers[k].force[i] = r[n + i];
    answers[k].does = !cones->slides[k] && size <= cones->mu[k] * pressed ? STICKS : SLIDES;
    for (int i = 0; i < 2 && answers[k].does == SLIDES && !cones->slides[k]; ++i) answers[k].direction[i] = -z[i] / size;
  }
}

/* Improve forces by Newton's method until they obey: 0 if that does not happen. */
static int newton(const cones_t* cones, double* r, answer_t* answers) {
  double trial[MC], after[MC], F[MC], J[MC][MC], step[MC];
  for (int i = 0; i < MC; ++i) trial[i] = r[i];
  double size = equations(cones, trial, F, J);
  for (int turn = 0; turn < STEPS; ++turn) {
    double left = 0.0, largest = 0.0, length = 1.0, next = size;
    for (int i = 0; i < MC; ++i) {
      left = fmax(left, fabs(F[i]));
      largest = fmax(largest, fabs(trial[i]));
      step[i] = -F[i];
    }
    if (left <= SOLVED * (largest + 1e-300)) {
      for (int i = 0; i < MC; ++i) r[i] = trial[i];
      read_answers(cones, r, answers);
      return 1;
    }
    if (!solve_dense(J, step)) return 0;
    for (int k = 0; k < HALVED; ++k) {
      for (int i = 0; i < MC; ++i) after[i] = trial[i] + length * step[i];
      next = equations(cones, after, F, J);
      if (next < (1.0 - 1e-4 * length) * size) break;
      length *= 0.5;
    }
    for (int i = 0; i < MC; ++i) trial[i] = after[i];
    size = next;
  }
  return 0;
}

/* Solve for several contacts: 0 if no answer is found. */
static int several(cones_t* cones, answer_t* answers) {
  static const int sweeps[2] = {SWEEPS, MORE_SWEEPS};
  double r[MC];
  int found = 0;
  for (int i = 0; i < MC; ++i) r[i] = 0.0;
  for (int k = 0; k < NC; ++k) cones->mu[k] = friction[k];
  for (int k = 0; k < 2; ++k)
    if (sweep(cones, r, sweeps[k], answers) || newton(cones, r, answers)) return 1;
  for (int i = 0; i < MC; ++i) r[i] = 0.0;
  for (int part = 0; part <= CONTINUED; ++part) {
    for (int k = 0; k < NC; ++k) cones->mu[k] = friction[k] * part / CONTINUED;
    found = sweep(cones, r, SWEEPS, answers) || newton(cones, r, answers);
  }
  return found;
}
