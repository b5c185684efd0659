/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of a scene with dry friction: smooth pieces between stops and break-aways. The same lines stand in Python in
 * dry_friction.py, with the reasons, for machines without a compiler; a test holds the two together.
 *
 * Before this file: NX, NU, NP, STATIC (levels at rest, a brace list), SZ_ARG, SZ_RES, SZ_IW, SZ_W (of the functions
 * called), EVENTS, PIVOTS, WORST_FIRST, BISECTIONS, ROUNDING, AT_REST; with error control also adaptive.c and ADAPTIVE.
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

/* Motion over h in one piece: 1 if every number stayed finite. */
static int flow(const real* x, piece_t* piece, real h, real* after) {
#ifdef ADAPTIVE
  for (int i = 0; i < NX; ++i) after[i] = x[i];
  return controlled_tick(after, piece->u, piece->p, h, piece->control);
#else
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  arg[0] = x; arg[1] = piece->u; arg[2] = piece->p; arg[3] = &h;
  res[0] = after;
  step(arg, res, iw, w, 0);
  for (int i = 0; i < NX; ++i)
    if (BEYOND(after[i], 1e150)) return 0;
  return 1;
#endif
}

/* Positive if a joint slides against its direction or sticks under too much load. */
static double wrongness(const real* x, const piece_t* piece) {
  const real *d = DIRECTION(piece), *v = x + NU;
  double turned = -INFINITY, overload = -INFINITY, fastest = 0.0;
  int stuck = 0;
  for (int i = 0; i < NU; ++i) {
    if (fabs(v[i]) > fastest) fastest = fabs(v[i]);
    if (!(static_level[i] > 0.0)) continue;
    if (d[i] == 0.0) stuck = 1;
    else if (-v[i] * d[i] > turned) turned = -v[i] * d[i];
  }
  turned -= ROUNDING * (1.0 + fastest);
  if (stuck) {
    real load[NU];
    evaluate_reaction(x, piece, load);
    for (int i = 0; i < NU; ++i)
      if (static_level[i] > 0.0 && d[i] == 0.0 && fabs(load[i]) - static_level[i] > overload)
        overload = fabs(load[i]) - static_level[i];
  }
  return turned > overload ? turned : overload;
}

/* The same after a motion of length t from x; tried only, so error control does not learn from it. */
static double wrong_after(const real* x, piece_t* piece, real t) {
  real after[NX];
#ifdef ADAPTIVE
  const control_t kept = *piece->control;
  const int ok = flow(x, piece, t, after);
  *piece->control = kept;
#else
  const int ok = flow(x, piece, t, after);
#endif
  return ok ? wrongness(after, piece) : INFINITY;
}

static double first_wrong(const real* x, piece_t* piece, double h) {
  double low = 0.0, high = h, f_low = wrong_after(x, piece, 0.0), f_high = wrong_after(x, piece, h);
  int side = 0;
  for (int k = 0; k < BISECTIONS && high - low > 4e-16 * h; ++k) {
    const double secant = isfinite(f_high) ? high - f_high * (high - low) / (f_high - f_low) : low;
    const double trial = low < secant && secant < high && k % 4 != 3 ? secant : 0.5 * (low + high);
    const double value = wrong_after(x, piece, trial);
    if (value > 0.0) {
      high = trial; f_high = value;
      if (side > 0) f_low *= 0.5;
      side = 1;
    } else {
      low = trial; f_low = value;
      if (side < 0) f_high *= 0.5;
      side = -1;
    }
  }
  return high;
}

/* 0 if a joint that is put at rest was still fast: the piece was no continuous motion. */
static int rest(real* x, const piece_t* piece) {
  const real* d = DIRECTION(piece);
  double fastest = 0.0;
  for (int i = 0; i < NU; ++i)
    if (fabs(x[NU + i]) > fastest) fastest = fabs(x[NU + i]);
  for (int i = 0; i < NU; ++i)
    if (static_level[i] > 0.0 && x[NU + i] * d[i] <= 0.0) {
      if (fabs(x[NU + i]) > AT_REST * (1.0 + fastest)) return 0;
      x[NU + i] = 0.0;
    }
  return 1;
}

static int dry_tick(real* x, piece_t* piece, double h) {
  real now[NX], after[NX];
  double left = h;
  for (int i = 0; i < NX; ++i) now[i] = x[i];
  for (long long event = 0; event < EVENTS; ++event) {
    double length = left;
    find_directions(now, piece);
    const int calm = wrong_after(now, piece, left) <= 0.0;
    if (!calm) length = first_wrong(now, piece, left);
    if (!flow(now, piece, length, after)) return 0;
    if (!rest(after, piece)) return 0;
    for (int i = 0; i < NX; ++i) now[i] = after[i];
    left -= length;
    if (calm || left <= 0.0) {
      for (int i = 0; i < NX; ++i) x[i] = now[i];
      return 1;
    }
  }
  return 0;
}

/* As roll() of roll.c, with the error estimate after each tick in `errors`. */
__attribute__((visibility("default")))
long long roll_dry(real* x, const real* command, long long stride, const real* p, double h, long long ticks,
                   real* trace, real* effort, real* errors, void* control) {
  real w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  piece_t piece;
  for (int i = 0; i < NP; ++i) piece.p[i] = p[i];
#ifdef ADAPTIVE
  piece.control = control;
#endif
  for (long long k = 0; k < ticks; ++k) {
    arg[0] = x; arg[1] = command + k * stride;
    res[0] = effort + k * NU;
    actuate(arg, res, iw, w, 0);
    piece.u = effort + k * NU;
    if (!dry_tick(x, &piece, h)) return k;
    for (int i = 0; i < NX; ++i) trace[k * NX + i] = x[i];
#ifdef ADAPTIVE
    errors[k] = piece.control->error;
#else
    errors[k] = 0.0;
#endif
  }
  return ticks;
}
