/* SPDX-License-Identifier: Apache-2.0
 *
 * What all ticks with events share: smooth pieces, the instants between them, and the roll. The same lines stand in
 * Python in events.py, with the reasons, for machines without a compiler; tests hold the two together.
 *
 * Before this file: dry_modes.c or contact_modes.c, whose piece_t holds the torque u that acts and the parameters p; NX, NU,
 * NP, SZ_ARG, SZ_RES, SZ_IW, SZ_W (of the functions called), BISECTIONS; with error control also adaptive.c and ADAPTIVE.
 * After it: event_tick().
 */

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

/* As flow(); error control does not learn from it. */
static int try_flow(const real* x, piece_t* piece, real h, real* after) {
#ifdef ADAPTIVE
  const control_t kept = *piece->control;
  const int ok = flow(x, piece, h, after);
  *piece->control = kept;
  return ok;
#else
  return flow(x, piece, h, after);
#endif
}

/* Where a value changes from not positive, at 0, to positive, at h: Illinois with bisections. */
static double first_positive(double (*value_at)(const void*, double), const void* search, double h) {
  double low = 0.0, high = h, f_low = value_at(search, 0.0), f_high = value_at(search, h);
  int side = 0;
  for (int k = 0; k < BISECTIONS && high - low > 4e-16 * h; ++k) {
    const double secant = isfinite(f_high) ? high - f_high * (high - low) / (f_high - f_low) : low;
    const double trial = low < secant && secant < high && k % 4 != 3 ? secant : 0.5 * (low + high);
    const double value = value_at(search, trial);
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

/* One tick of length h from x, in place: 1 if it could be computed. */
static int event_tick(real* x, piece_t* piece, double h, void* memory);

/* As roll() of roll.c, with the error estimate after each tick in `errors`. */
__attribute__((visibility("default")))
long long roll_events(real* x, const real* command, long long stride, const real* p, double h, long long ticks,
                       real* trace, real* effort, real* errors, void* control, void* memory) {
  real acted[NU], w[SZ_W];
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
    res[0] = acted;
    actuate(arg, res, iw, w, 0);
    piece.u = acted;
    if (!event_tick(x, &piece, h, memory)) return k;
    for (int i = 0; i < NU; ++i) effort[k * NU + i] = acted[i];
    for (int i = 0; i < NX; ++i) trace[k * NX + i] = x[i];
#ifdef ADAPTIVE
    errors[k] = piece.control->error;
#else
    errors[k] = 0.0;
#endif
  }
  return ticks;
}
