/* SPDX-License-Identifier: Apache-2.0
 *
 * Backward pass of iLQR with limits of the command: Tassa, Mansard, Todorov, "Control-limited differential dynamic
 * programming", ICRA 2014.
 *
 * Required definitions: NX, NU (lengths of state and command). Matrices are stored by rows.
 */
#include <math.h>
#include <string.h>

#ifndef NX /* read alone, as editors do */
#define NX 4
#define NU 2
#endif
#define NS (NX + NU)
#define EXPORTED __attribute__((visibility("default")))
/* Each command may come to a limit, and leave it, more than once; a step is halved until it is rounding. */
enum { MOST_ITERATIONS = 20 + 4 * NU, MOST_HALVINGS = 40 };

/* Cholesky factor L of the free rows and columns of H; returns whether they are positive definite. */
static int factor(const double H[NU][NU], const int* at, int count, double L[NU][NU]) {
  for (int i = 0; i < count; ++i)
    for (int j = 0; j <= i; ++j) {
      double sum = H[at[i]][at[j]];
      for (int m = 0; m < j; ++m) sum -= L[i][m] * L[j][m];
      if (i > j) L[i][j] = sum / L[j][j];
      else if (sum > 0.0) L[i][i] = sqrt(sum);
      else return 0;
    }
  return 1;
}

/* Solve L Lᵀ y = y in place for `width` right-hand sides; row i is at y + i * width. */
static void solve(const double L[NU][NU], int count, int width, double* y) {
  for (int i = 0; i < count; ++i) {
    for (int m = 0; m < i; ++m)
      for (int c = 0; c < width; ++c) y[i * width + c] -= L[i][m] * y[m * width + c];
    for (int c = 0; c < width; ++c) y[i * width + c] /= L[i][i];
  }
  for (int i = count - 1; i >= 0; --i) {
    for (int m = i + 1; m < count; ++m)
      for (int c = 0; c < width; ++c) y[i * width + c] -= L[m][i] * y[m * width + c];
    for (int c = 0; c < width; ++c) y[i * width + c] /= L[i][i];
  }
}

/* ½ kᵀ H k + gᵀ k. */
static double value(const double H[NU][NU], const double* g, const double* k) {
  double sum = 0.0;
  for (int i = 0; i < NU; ++i) {
    double row = g[i];
    for (int j = 0; j < NU; ++j) row += 0.5 * H[i][j] * k[j];
    sum += row * k[i];
  }
  return sum;
}

/* Minimize ½ kᵀ H k + gᵀ k within limits by projected Newton steps (Bertsekas, SIAM J. Control 20, 1982). `at` receives the
 * indices of entries that are not at a limit, L the factor of their part of H. Returns their number, or -1 if H is not
 * positive definite there.
 */
static int minimize(const double H[NU][NU], const double* g, const double* low, const double* high, double* k, int* at,
                    double L[NU][NU]) {
  int count = 0, before = 0, last[NU], inside = 0;
  for (int iteration = 0; iteration < MOST_ITERATIONS; ++iteration) {
    double slope[NU], step[NU], trial[NU];
    for (int i = 0; i < NU; ++i) {
      slope[i] = g[i];
      for (int j = 0; j < NU; ++j) slope[i] += H[i][j] * k[j];
    }
    before = count;
    memcpy(last, at, sizeof last);
    count = 0;
    for (int i = 0; i < NU; ++i)
      if (!(k[i] <= low[i] && slope[i] > 0.0) && !(k[i] >= high[i] && slope[i] < 0.0)) at[count++] = i;
    if (inside && count == before && !memcmp(last, at, count * sizeof(int))) return count;
    if (count == 0) return 0;
    if (!factor(H, at, count, L)) return -1;
    for (int i = 0; i < count; ++i) step[i] = -slope[at[i]];
    solve(L, count, 1, step);
    const double now = value(H, g, k);
    double size = 1.0;
    for (int halving = 0;; ++halving, size *= 0.5) {
      double change = 0.0;
      inside = halving == 0;
      memcpy(trial, k, sizeof trial);
      for (int i = 0; i < count; ++i) {
        const int m = at[i];
        const double target = k[m] + size * step[i];
        trial[m] = fmin(high[m], fmax(low[m], target));
        inside &= trial[m] == target;
        change += slope[m] * (trial[m] - k[m]);
      }
      if (value(H, g, trial) <= now + 0.1 * change) break; /* Armijo's rule */
      if (halving == MOST_HALVINGS) return count; /* only rounding is left */
    }
    memcpy(k, trial, sizeof trial);
  }
  return count;
}

/* Add A B to C; A has `row` numbers from a row to the next, `step` from a column to the next. */
static void add_product(int rows, int inner, int columns, const double* A, int row, int step, const double* B, double* C) {
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < inner; ++j)
      for (int c = 0; c < columns; ++c) C[i * columns + c] += A[i * row + j * step] * B[j * columns + c];
}

/* The policy du = k + K dx that improves a trajectory.
 *
 * slopes:     A and B of each node side by side, nodes * NX * (NX + NU).
 * lx, lxx:    cost by the state, (nodes + 1) * NX and * NX * NX.
 * lu, luu:    cost by the command, nodes * NU and * NU * NU.
 * low, high:  limits of du, nodes * NU.
 * damping:    regularization: multiple of luu that is added to it for k and K.
 * k, K:       receive the policy, nodes * NU and nodes * NU * NX.
 * change:     receives the predicted change of the cost under this policy.
 * Returns nodes on success, else the node at which the curvature by the command is not positive.
 */
EXPORTED long long ilqr_backward(long long nodes, const double* slopes, const double* lx, const double* lxx, const double* lu,
                                 const double* luu, const double* low, const double* high, double damping, double* k,
                                 double* K, double* change) {
  double V[NX][NX], v[NX];
  memcpy(V, lxx + nodes * NX * NX, sizeof V);
  memcpy(v, lx + nodes * NX, sizeof v);
  *change = 0.0;
  for (long long node = nodes - 1; node >= 0; --node) {
    const double (*S)[NS] = (const double (*)[NS])(slopes + node * NX * NS);
    const double *cxx = lxx + node * NX * NX, *cuu = luu + node * NU * NU;
    double *kn = k + node * NU, (*Kn)[NX] = (double (*)[NX])(K + node * NU * NX);
    double W[NX][NS], Q[NS][NS], q[NS], H[NU][NU], L[NU][NU], T[NU][NX], t[NU], rows[NU][NX];
    int at[NU] = {0};
    /* Quadratic model of the cost-to-go by (x, u): Q = Sᵀ V S, q = Sᵀ v, plus the node's own cost. Its part by the
     * command, Q_uu, begins at Q[NX] + NX, and q_u at q + NX. */
    memset(W, 0, sizeof W);
    memset(Q, 0, sizeof Q);
    memcpy(q, lx + node * NX, NX * sizeof(double));
    memcpy(q + NX, lu + node * NU, NU * sizeof(double));
    add_product(NX, NX, NS, V[0], NX, 1, S[0], W[0]);
    add_product(NS, NX, NS, S[0], 1, NS, W[0], Q[0]);
    add_product(NS, NX, 1, S[0], 1, NS, v, q);
    for (int i = 0; i < NX; ++i)
      for (int c = 0; c < NX; ++c) Q[i][c] += cxx[i * NX + c];
    for (int i = 0; i < NU; ++i)
      for (int c = 0; c < NU; ++c) {
        Q[NX + i][NX + c] += cuu[i * NU + c];
        H[i][c] = Q[NX + i][NX + c] + damping * cuu[i * NU + c];
      }
    for (int i = 0; i < NU; ++i) kn[i] = fmin(high[node * NU + i], fmax(low[node * NU + i], 0.0));
    const int count = minimize(H, q + NX, low + node * NU, high + node * NU, kn, at, L);
    if (count < 0) return node;
    /* A command at its limit has no feedback. */
    memset(Kn, 0, NU * NX * sizeof(double));
    for (int i = 0; i < count; ++i)
      for (int c = 0; c < NX; ++c) rows[i][c] = -Q[NX + at[i]][c];
    solve(L, count, NX, rows[0]);
    for (int i = 0; i < count; ++i) memcpy(Kn[at[i]], rows[i], sizeof rows[i]);
    /* The cost-to-go under the policy. */
    for (int i = 0; i < NU; ++i) memcpy(T[i], Q[NX + i], sizeof T[i]);
    memset(t, 0, sizeof t);
    add_product(NU, NU, NX, Q[NX] + NX, NS, 1, Kn[0], T[0]);
    add_product(NU, NU, 1, Q[NX] + NX, NS, 1, kn, t);
    for (int i = 0; i < NU; ++i) {
      *change += kn[i] * (q[NX + i] + 0.5 * t[i]);
      t[i] += q[NX + i];
    }
    for (int i = 0; i < NX; ++i) memcpy(V[i], Q[i], sizeof V[i]);
    memcpy(v, q, sizeof v);
    add_product(NX, NU, NX, Kn[0], 1, NX, T[0], V[0]);
    add_product(NX, NU, NX, Q[NX], 1, NS, Kn[0], V[0]);
    add_product(NX, NU, 1, Kn[0], 1, NX, t, v);
    add_product(NX, NU, 1, Q[NX], 1, NS, kn, v);
    for (int i = 0; i < NX; ++i)
      for (int c = 0; c < i; ++c) V[i][c] = V[c][i] = 0.5 * (V[i][c] + V[c][i]);
  }
  return nodes;
}
