/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of error-controlled sub-steps. The torque is constant within a tick, so every sub-step sees a smooth equation.
 * Step size: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 1993, section II.4. The same few lines
 * stand in Python in adaptive.py, for machines without a compiler; a test holds the two together.
 *
 * Before this file: NX, NU, ORDER (of the error estimate plus one), SZ_ARG, SZ_RES, SZ_IW, SZ_W (of `attempt` and `actuate`),
 * SUBSTEPS (most attempts a tick may take).
 */

typedef struct {
  double tolerance; /* scaled error that a sub-step may have */
  double step;      /* length to try next; 0: not known yet */
  double error;     /* sum of the estimated errors of q */
  long long attempts;
} control_t;

/* Advance one tick of length h from x, in place: 1 if every number stayed finite and the tolerance was met. */
static int controlled_tick(real* x, const real* u, const real* p, double h, control_t* c) {
  real next[NX], error, error_q, trial, w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  double done = 0.0;
  double step = c->step > 0.0 ? c->step : h;
  for (long long k = 0; k < SUBSTEPS; ++k) {
    const double left = h - done;
    const int last = step >= left * (1.0 - 1e-12);
    trial = last ? left : step;
    arg[0] = x; arg[1] = u; arg[2] = p; arg[3] = &trial;
    res[0] = next; res[1] = &error; res[2] = &error_q;
    attempt(arg, res, iw, w, 0);
    ++c->attempts;
    const double size = error / c->tolerance;
    int reached = 1;
    for (int i = 0; i < NX; ++i) reached &= !BEYOND(next[i], 1e150);
    const int accepted = size <= 1.0 && reached;
    double factor = size < 1e-10 ? 6.0 : 0.9 * pow(size, -1.0 / ORDER); /* NaN must shrink it */
    factor = !(factor > 0.2) || !reached ? 0.2 : factor > 6.0 ? 6.0 : factor;
    if (accepted) {
      for (int i = 0; i < NX; ++i) x[i] = next[i];
      c->error += error_q;
      done += trial;
      /* A last sub-step that was cut short says little of how long the next may be. */
      if (!last || trial * factor > step) step = trial * factor;
      if (last) { c->step = step; return 1; }
    } else {
      step = trial * factor;
      if (step < 1e-12 * h) return 0;
    }
  }
  return 0;
}

/* As roll() of roll.c, with the error estimate after each tick in `errors`. */
__attribute__((visibility("default")))
long long roll_adaptive(real* x, const real* command, long long stride, const real* p, double h, long long ticks,
                        real* trace, real* effort, real* errors, control_t* control) {
  real acted[NU], before[NX], w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  for (long long k = 0; k < ticks; ++k) {
    arg[0] = x;
    arg[1] = command + k * stride;
    res[0] = acted;
    actuate(arg, res, iw, w, 0);
    for (int i = 0; i < NX; ++i) before[i] = x[i];
    if (!controlled_tick(x, acted, p, h, control)) {
      for (int i = 0; i < NX; ++i) x[i] = before[i];
      return k;
    }
    for (int i = 0; i < NX; ++i) trace[k * NX + i] = x[i];
    for (int i = 0; i < NU; ++i) effort[k * NU + i] = acted[i];
    errors[k] = control->error;
  }
  return ticks;
}
