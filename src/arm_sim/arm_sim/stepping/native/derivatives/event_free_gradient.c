/* SPDX-License-Identifier: Apache-2.0
 *
 * Gradients of functions of the states of ticks without events of one arm, in a scene with events. The states between which
 * ticks move and their modes are kept; the motion within a tick is recomputed in the backward pass.
 */
#include "derivatives/event_free_ticks.h"

/* What is kept of a tick: its state before, the ends of its motion, and its modes. */
typedef struct {
  double *x, *begin, *end, *p;
} tick_motion_t;
#define TICK_MOTION (3 * NX + P_LENGTH)

static tick_motion_t tick_motion_of(const scene_t* scene, double* motion, long long tick) {
  double* numbers = motion + tick * TICK_MOTION;
  tick_motion_t kept = {numbers, numbers + NX, numbers + 2 * NX, numbers + 3 * NX};
  return kept;
}

/* How many numbers are kept of a tick. */
EXPORTED long long numbers_per_tick(const scene_t* scene) { return TICK_MOTION; }

/* Make ticks under the commands tau, a row for each, up to the first that has an event: their number. `state_varied`: whether
 * the first state is itself varied; `after` receives the last state. */
EXPORTED long long event_free_motion(const scene_t* scene, const double* x0, const double* tau, const double* p, double h,
                                     long long ticks, const engine_t* engine, int state_varied, double* motion,
                                     double* after) {
  copy(after, x0, NX);
  for (long long k = 0; k < ticks; ++k) {
    real u[NU];
    LOCAL_PREDICTIONS(prediction);
    LOCAL(event_free_lanes_t, tick, event_free_lanes_of, EVENT_FREE_LANES);
    real place[PLACES + 1];
    int event_free = 1;
    CALL(scene->acting, (after, tau + k * NU), (u));
    begin_ticks(scene, after, u, p, &h, prediction, place);
    make_event_free(scene, prediction, after, u, engine, state_varied && !k, &event_free, &tick);
    if (!event_free) return k;
    const tick_motion_t kept = tick_motion_of(scene, motion, k);
    copy(kept.x, after, NX);
    copy(kept.begin, tick.begin, NX);
    copy(kept.end, tick.end, NX);
    copy(kept.p, tick.p, P_LENGTH);
    copy(after, tick.after, NX);
  }
  return ticks;
}

/* Gradients of a motion of event_free_motion.
 *
 * weight: gradient by its last state, which becomes that by its first one, going back tick by tick.
 * g:      gradients by the states at the beginning of each tick, NX numbers.
 * by_tau: receives gradients by the commands, NU for each tick.
 * by_p:   gradients by parameters, NP, added to what is there.
 */
EXPORTED void event_free_gradient(const scene_t* scene, double* motion, const double* tau, double h, long long ticks,
                                  const double* g, double* weight, double* by_tau, double* by_p) {
  for (long long k = ticks - 1; k >= 0; --k) {
    const tick_motion_t tick = tick_motion_of(scene, motion, k);
    real u[NU], back[NX], by_begin[NX], by_end[NX], more[NX], of_u[NU], of_p[NP + 1], coefficients[NBEGIN + NEND + 1];
    clear(by_begin, NX);
    CALL(scene->acting, (tick.x, tau + k * NU), (u));
    if (any_closed(scene, tick.p)) { /* which are closed at the end */
      CALL(scene->end_coefficients, (tick.begin, tick.end, tick.p), (coefficients));
      CALL(scene->end_adjoint, (coefficients, weight), (by_begin, by_end));
      copy(weight, by_end, NX);
    }
    CALL(scene->adjoint, (tick.begin, u, tick.p, &h, weight), (back, of_u, of_p));
    for (int i = 0; i < NX; ++i) back[i] += by_begin[i];
    if (!all_moves(scene, tick.p)) { /* what is held is brought to rest at the beginning */
      CALL(scene->begin_coefficients, (tick.begin, u, tick.p), (coefficients));
      CALL(scene->begin_adjoint, (coefficients, back), (by_begin));
      copy(back, by_begin, NX);
    }
    CALL(scene->limit_adjoint, (tick.x, tau + k * NU, of_u), (more, by_tau + k * NU));
    for (int i = 0; i < NX; ++i) weight[i] = back[i] + more[i] + g[k * NX + i];
    for (int i = 0; i < NP; ++i) by_p[i] += of_p[i];
  }
}
