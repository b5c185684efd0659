/* SPDX-License-Identifier: Apache-2.0
 *
 * Many ticks in one call. Compiled with the generated functions of a scene, once with `real` a double and once with
 * `real` a vector of them (one arm a lane).
 *
 * Before this file: NX, NU (lengths of state and torque), TICK (name of the generated tick), SZ_ARG, SZ_RES, SZ_IW, SZ_W
 * (its work space).
 */

static int finite_state(const real* x) {
  for (int i = 0; i < NX; ++i)
    if (BEYOND(x[i], 1e150)) return 0;
  return 1;
}

/* Advance `ticks` ticks of fixed length h[0] from x, in place.
 *
 * command: what is commanded in the first tick; the next tick's is `stride` numbers further (0: held throughout).
 * trace:   state after every tick.            effort: torque that acted in every tick.
 * Returns the number of ticks after which every number was finite; x is the last such state.
 */
__attribute__((visibility("default")))
long long roll(real* x, const real* command, long long stride, const real* p, const real* h, long long ticks,
               real* trace, real* effort) {
  real next[NX], acted[NU], w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG];
  real* res[SZ_RES];
  for (long long k = 0; k < ticks; ++k) {
    arg[0] = x;
    arg[1] = command + k * stride;
    arg[2] = p;
    arg[3] = h;
    res[0] = next;
    res[1] = acted;
    TICK(arg, res, iw, w, 0);
    if (!finite_state(next)) return k;
    for (int i = 0; i < NX; ++i) x[i] = next[i];
    for (int i = 0; i < NX; ++i) trace[k * NX + i] = next[i];
    for (int i = 0; i < NU; ++i) effort[k * NU + i] = acted[i];
  }
  return ticks;
}
