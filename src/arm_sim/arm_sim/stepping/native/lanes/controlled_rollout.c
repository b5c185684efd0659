/* SPDX-License-Identifier: Apache-2.0
 *
 * Many arms under error control, LANES at a time. Only attempts are made side by side: every lane has ticks and sub-steps
 * of its own, and takes the next arm when it is done with one.
 */

#include "lanes/lanes.h"
#include "lanes/prediction.h"
#include "motion/step_control.h"

/* The arguments of `rollout`. */
typedef struct {
  const double *x0, *tau, *p;
  long long tau_arm, tau_tick, p_arm, ticks, last;
  double h;
  double *out, *effort;
  int last_only;
  signed char* met;
} batch_t;

typedef struct {
  long long arm;   /* batch.last: there is none left for this lane */
  long long tick;
  long long tried; /* sub-steps of this tick */
  int begins;      /* whether a tick begins */
  substeps_t at;
} lane_t;

typedef struct {
  lane_t lane[LANES];
  long long waiting; /* the next arm */
  real x[NX]; /* states at the beginning of the sub-step */
  real r[NR], u[NU], p[NP + 1], length;
} group_t;

static void store(const batch_t* batch, const group_t* group, int j) {
  const lane_t* own = group->lane + j;
  double* to = batch->out + own->arm * NX * (batch->last_only ? 1 : batch->ticks + 1);
  if (batch->last_only && own->tick < batch->ticks) return;
  for (int i = 0; i < NX; ++i) to[(batch->last_only ? 0 : own->tick * NX) + i] = LANE(group->x[i], j);
}

/* Give a lane the next arm that has a tick to make, or none. */
static void take_arm(const batch_t* batch, group_t* group, int j) {
  lane_t* own = group->lane + j;
  do {
    own->arm = group->waiting;
    if (own->arm >= batch->last) return;
    ++group->waiting;
    own->tick = 0;
    own->begins = 1;
    own->at.step = 0.0;
    for (int i = 0; i < NX; ++i) LANE(group->x[i], j) = batch->x0[own->arm * NX + i];
    for (int i = 0; i < NP; ++i) LANE(group->p[i], j) = batch->p[own->arm * batch->p_arm + i];
    store(batch, group, j);
  } while (!batch->ticks);
}

static void begin_tick(const batch_t* batch, group_t* group, int j, const real* acted) {
  lane_t* own = group->lane + j;
  own->begins = 0;
  own->tried = 0;
  own->at = first_substep(batch->h, own->at.step);
  for (int i = 0; i < NU; ++i) LANE(group->u[i], j) = LANE(acted[i], j);
  for (int i = 0; batch->effort && i < NU; ++i)
    batch->effort[(own->arm * batch->ticks + own->tick) * NU + i] = LANE(acted[i], j);
}

/* Find what acts in the ticks that begin. */
static void begin_ticks(const batch_t* batch, group_t* group) {
  real acted[NU], w[SZ_W];
  casadi_int iw[SZ_IW];
  const real* arg[SZ_ARG] = {group->x, group->r};
  real* res[SZ_RES] = {acted};
  int any = 0;
  for (int j = 0; j < LANES; ++j) {
    const lane_t* own = group->lane + j;
    const double* r = batch->tau + own->arm * batch->tau_arm + own->tick * batch->tau_tick;
    if (own->arm >= batch->last || !own->begins) continue;
    for (int i = 0; i < NR; ++i) LANE(group->r[i], j) = r[i];
    any = 1;
  }
  if (!any) return;
  actuate(arg, res, iw, w, 0);
  for (int j = 0; j < LANES; ++j)
    if (group->lane[j].arm < batch->last && group->lane[j].begins) begin_tick(batch, group, j, acted);
}

/* Accept an attempt of a lane, or not. */
static void end_attempt(const batch_t* batch, group_t* group, int j, const real* next, double error) {
  lane_t* own = group->lane + j;
  const enum outcome outcome = control_step(&own->at, batch->h, error / TOLERANCE, within_reach(next, j));
  const int accepted = outcome == ACCEPTED || outcome == ENDED;
  const int meets = accepted && meets_any_stop(group->x, next, own->at.trial, j);
  if (accepted)
    for (int i = 0; i < NX; ++i) LANE(group->x[i], j) = LANE(next[i], j);
  if (outcome == STEP_TOO_SMALL || (++own->tried == MOST_SUBSTEPS && outcome != ENDED) || meets) {
    batch->met[own->arm] = 1;
    take_arm(batch, group, j);
  } else if (outcome == ENDED) {
    ++own->tick;
    own->begins = 1;
    store(batch, group, j);
    if (own->tick == batch->ticks) take_arm(batch, group, j);
  }
}

/* Whether a lane has an arm. */
static int busy(const batch_t* batch, const group_t* group) {
  int any = 0;
  for (int j = 0; j < LANES; ++j) any |= group->lane[j].arm < batch->last;
  return any;
}

/* As `rollout` of rollout.c. met: set to 1 also for an arm that cannot be advanced. */
EXPORTED void rollout(const double* x0, const double* tau, long long tau_arm, long long tau_tick, const double* p,
                      long long p_arm, const double* h, long long ticks, long long first, long long last, double* out,
                      int last_only, signed char* met, double* effort, const engine_t* engine) {
  (void)engine;
  const batch_t batch = {x0, tau, p, tau_arm, tau_tick, p_arm, ticks, last, h[0], out, effort, last_only, met};
  real next[NX], error, error_q, w[SZ_W];
  casadi_int iw[SZ_IW];
  group_t group;
  group.waiting = first;
  group.length = h[0];
  for (int i = 0; i < NR; ++i) group.r[i] = 0.0;
  for (int i = 0; i < NU; ++i) group.u[i] = 0.0;
  for (int j = 0; j < LANES; ++j) { /* what a lane without an arm computes does not matter */
    for (int i = 0; i < NX; ++i) LANE(group.x[i], j) = x0[first * NX + i];
    for (int i = 0; i < NP; ++i) LANE(group.p[i], j) = p[first * p_arm + i];
  }
  for (int j = 0; j < LANES; ++j) take_arm(&batch, &group, j);
  while (!HALTED && busy(&batch, &group)) {
    const real* arg[SZ_ARG] = {group.x, group.u, group.p, &group.length};
    real* res[SZ_RES] = {next, &error, &error_q};
    begin_ticks(&batch, &group);
    for (int j = 0; j < LANES; ++j)
      if (group.lane[j].arm < last) LANE(group.length, j) = next_length(&group.lane[j].at, h[0]);
    attempt(arg, res, iw, w, 0);
    for (int j = 0; j < LANES; ++j)
      if (group.lane[j].arm < last) end_attempt(&batch, &group, j, next, LANE(error, j));
  }
}
