/* SPDX-License-Identifier: Apache-2.0
 *
 * Many arms, LANES at a time. C where `real` is a double, C++ where it is a vector of them.
 *
 * Before this file: as for roll.c, and NP (length of the parameters); where joints have stops also stops.c, and STOPS.
 */

#ifdef __cplusplus
extern "C"
#endif
/* Advance the arms first … last-1.
 *
 * x0:   initial states, NX an arm.
 * tau:  torques; arm i, tick k at tau + i * tau_arm + k * tau_tick.
 * p:    parameters; arm i at p + i * p_arm.
 * out:  states of every tick, the first included, (ticks + 1) * NX an arm; if last_only, NX an arm.
 * met:  set to 1 for an arm that meets a stop; its states are worth nothing from there on.
 * An arm that diverges is NaN from there on; its neighbours do not notice.
 */
__attribute__((visibility("default")))
void rollout(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
             long long p_arm, const double* h, long long ticks, long long first, long long last, double* out,
             int last_only, signed char* met) {
  const long long row = last_only ? NX : (ticks + 1) * NX;
  const real length = h[0];
  for (long long arm = first; arm < last; arm += LANES) {
    real x[NX], next[NX], r[NU], acted[NU], par[NP + 1], w[SZ_W];
    casadi_int iw[SZ_IW];
    const real* arg[SZ_ARG];
    real* res[SZ_RES];
    long long of_lane[LANES]; /* spare lanes of the last group repeat its last arm */
    for (int j = 0; j < LANES; ++j) of_lane[j] = arm + j < last ? arm + j : last - 1;
    for (int j = 0; j < LANES; ++j) {
      for (int i = 0; i < NX; ++i) LANE(x[i], j) = x0[of_lane[j] * NX + i];
      for (int i = 0; i < NP; ++i) LANE(par[i], j) = p[of_lane[j] * p_arm + i];
    }
    for (long long k = 0; k <= ticks; ++k) {
      if (!last_only || k == ticks)
        for (int j = 0; j < LANES && arm + j < last; ++j)
          for (int i = 0; i < NX; ++i) out[(arm + j) * row + (last_only ? 0 : k * NX) + i] = LANE(x[i], j);
      if (k == ticks) break;
      if (k == 0 || tau_tick)
        for (int j = 0; j < LANES; ++j)
          for (int i = 0; i < NU; ++i) LANE(r[i], j) = tau[of_lane[j] * tau_arm + k * tau_tick + i];
      arg[0] = x; arg[1] = r; arg[2] = par; arg[3] = &length;
      res[0] = next; res[1] = acted;
      TICK(arg, res, iw, w, 0);
#ifdef STOPS
      for (int j = 0; j < LANES; ++j)
        for (int i = 0; i < NU; ++i) {
          const double q = LANE(x[i], j), v = LANE(x[NU + i], j), v_end = LANE(next[NU + i], j);
          met[of_lane[j]] |=
              reaches_stop(q, i) | reaches_stop(LANE(next[i], j), i) | (may_dip(q, v, v_end, h[0], i) != 0);
        }
#else
      (void)met;
#endif
      for (int i = 0; i < NX; ++i) x[i] = next[i];
      for (int i = 0; i < NX; ++i)
        if (BEYOND(x[i], 1e150))
          for (int j = 0; j < LANES; ++j)
            if (!(__builtin_fabs(LANE(x[i], j)) <= 1e150))
              for (int m = 0; m < NX; ++m) LANE(x[m], j) = __builtin_nan("");
    }
  }
}
