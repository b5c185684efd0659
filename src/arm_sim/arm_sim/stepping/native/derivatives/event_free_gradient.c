/* SPDX-License-Identifier: Apache-2.0
 *
 * Gradients of functions of the states of ticks without events of one arm, in a scene with events. The states between which
 * ticks move and their modes are kept; the motion within a tick is recomputed in the backward pass.
 */
#include "derivatives/adjoints.h"
#include "derivatives/event_free_ticks.h"

#include <string.h>

/* What is kept of a tick. */
typedef struct {
  double x[NX], begin[NX], end[NX], p[NP + MODES + 1];
} kept_t;

/* Size of what is kept of a tick, in numbers. */
EXPORTED long long kept_numbers(void) { return sizeof(kept_t) / sizeof(double); }

/* Make ticks under the commands tau, a row for each, up to the first that has an event: their number. `starts`: whether the
 * state at the beginning is itself varied; `after` receives that at the end. */
EXPORTED long long event_free_motion(const double* x0, const double* tau, const double* p, double h, long long ticks,
                                     const engine_t* engine, int starts, kept_t* motion, double* after) {
  memcpy(after, x0, NX * sizeof *after);
  for (long long k = 0; k < ticks; ++k) {
    real u[NU];
    prediction_t begun;
    event_free_lanes_t tick;
    real place[PLACES + 1];
    int event_free = 1;
    find_command(after, tau + k * NU, u);
    begin_ticks(after, u, p, &h, &begun, place);
    make_event_free(&begun, after, u, engine, starts && !k, &event_free, &tick);
    if (!event_free) return k;
    memcpy(motion[k].x, after, sizeof motion[k].x);
    memcpy(motion[k].begin, tick.begin, sizeof tick.begin);
    memcpy(motion[k].end, tick.end, sizeof tick.end);
    memcpy(motion[k].p, tick.p, sizeof tick.p);
    memcpy(after, tick.after, sizeof tick.after);
  }
  return ticks;
}

/* Gradient by the state reached from that after the closed contacts are closed; adds to those by x and by parameters. */
static void through_end(const kept_t* tick, real* weight, real* by_begin, real* by_p) {
  real coefficients[NEND + 1], back[NX], of_p[NP + 1], w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {tick->begin, tick->end, tick->p};
  real* res[SZ_RES] = {coefficients};
  rest_end(arg, res, iw, w, 0);
  arg[0] = coefficients;
  arg[1] = weight;
  res[0] = by_begin;
  res[1] = back;
  res[2] = of_p;
  end_adjoint(arg, res, iw, w, 0);
  memcpy(weight, back, sizeof back);
  for (int i = 0; i < NP; ++i) by_p[i] += of_p[i];
}

/* Gradient by the state before what is held is brought to rest, in place. */
static void through_begin(const kept_t* tick, const real* u, real* weight) {
  real coefficients[NBEGIN + 1], back[NX], w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {tick->begin, u, tick->p};
  real* res[SZ_RES] = {coefficients};
  rest_begin(arg, res, iw, w, 0);
  arg[0] = coefficients;
  arg[1] = weight;
  res[0] = back;
  begin_adjoint(arg, res, iw, w, 0);
  memcpy(weight, back, sizeof back);
}

/* Gradients of a motion of event_free_motion, from the weight of its last state, which becomes that of its first one.
 *
 * g:      gradients by the states at the beginning of each tick, NX numbers.
 * by_tau: receives gradients by the commands, NU for each tick.         by_p: gradients by parameters, NP, added.
 */
EXPORTED void event_free_gradient(const kept_t* motion, const double* tau, double h, long long ticks, const double* g,
                                  double* weight, double* by_tau, double* by_p) {
  for (long long k = ticks - 1; k >= 0; --k) {
    const kept_t* tick = motion + k;
    real u[NU], back[NX], begun[NX], more[NX], of_u[NU], of_p[NP + 1];
    memset(begun, 0, sizeof begun);
    find_command(tick->x, tau + k * NU, u);
    if (touches(tick->p)) through_end(tick, weight, begun, by_p);
    through_motion(tick->begin, u, tick->p, &h, weight, back, of_u, of_p);
    for (int i = 0; i < NX; ++i) back[i] += begun[i];
    if (!all_moves(tick->p + NP)) through_begin(tick, u, back);
    through_command(tick->x, tau + k * NU, of_u, more, by_tau + k * NU);
    for (int i = 0; i < NX; ++i) weight[i] = back[i] + more[i] + g[k * NX + i];
    for (int i = 0; i < NP; ++i) by_p[i] += of_p[i];
  }
}
