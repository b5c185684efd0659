/* SPDX-License-Identifier: Apache-2.0
 *
 * What joints with dry friction do next. The same lines stand in Python in dry_friction.py, with the reasons, for machines
 * without a compiler; a test holds the two together.
 *
 * Before this file: NX, NU, NP, STATIC (levels at rest, a brace list), SZ_ARG, SZ_RES, SZ_IW, SZ_W (of the functions
 * called), PIVOTS, WORST_FIRST; with error control also adaptive.c and ADAPTIVE.
 */

static const double static_level[NU] = STATIC;

typedef struct {
  const real* u;   /* torque that acts */
  real p[NP + NU]; /* parameters, then the directions */
#ifdef ADAPTIVE
  control_t* control;
#endif
} piece_t;

#define DIRECTION(piece) ((piece)->p + NP)

static void evaluate_reaction(const real* x, const piece_t* piece, real* load) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  arg[0] = x; arg[1] = x + NU; arg[2] = piece->u; arg[3] = piece->p;
  res[0] = load;
  reaction(arg, res, iw, w, 0);
}

static void evaluate_slope(const real* x, const piece_t* piece, real* slope) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  arg[0] = x; arg[1] = piece->u; arg[2] = piece->p;
  res[0] = slope;
  rhs(arg, res, iw, w, 0);
}

static real sign_of(real x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }

static void find_directions(const real* x, piece_t* piece) {
  real *d = DIRECTION(piece), load[NU], slope[NX];
  const real* a = slope + NU;
  int any = 0, resting[NU];
  double highest = 0.0;
  for (int i = 0; i < NU; ++i) {
    d[i] = static_level[i] > 0.0 ? sign_of(x[NU + i]) : 1.0;
    resting[i] = static_level[i] > 0.0 && x[NU + i] == 0.0;
    any |= resting[i];
    if (static_level[i] > highest) highest = static_level[i];
  }
  for (long long pivot = 0; any && pivot < PIVOTS; ++pivot) {
    int joint = -1;
    double worst = 0.0, largest = 0.0;
    evaluate_reaction(x, piece, load);
    evaluate_slope(x, piece, slope);
    for (int i = 0; i < NU; ++i)
      if (fabs(a[i]) > largest) largest = fabs(a[i]);
    for (int i = 0; i < NU; ++i) {
      const int stuck = d[i] == 0.0;
      const double excess = stuck ? (fabs(load[i]) - static_level[i]) / highest : -d[i] * a[i];
      if (!resting[i] || !(excess > (stuck ? 0.0 : 1e-9 * (1.0 + largest)))) continue;
      if (joint < 0 || (pivot < WORST_FIRST && excess > worst)) {
        joint = i;
        worst = excess;
      }
    }
    if (joint < 0) return;
    d[joint] = d[joint] == 0.0 ? sign_of(load[joint]) : 0.0;
  }
}
