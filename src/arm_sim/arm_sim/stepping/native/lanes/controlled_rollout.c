/* SPDX-License-Identifier: Apache-2.0
 *
 * Many arms under error control, LANES at a time. Only attempts are made side by side: every lane has ticks and sub-steps
 * of its own, and takes the next arm when it is done with one.
 */

#include "lanes/lanes.h"
#include "motion/step_control.h"

/* What is advanced, and where it goes: the arguments of `rollout`. */
typedef struct {
  const arms_t* arms;
  long long last;
  double* out;
  int last_only;
  double* effort;
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
  real *x, *r, *u, *p; /* states at the beginning of the sub-step, inputs, what acts, tunable numbers */
  real length;
} group_t;

static void store(const scene_t* scene, const batch_t* batch, const group_t* group, int j) {
  const lane_t* own = group->lane + j;
  double* to = batch->out + own->arm * NX * (batch->last_only ? 1 : batch->arms->ticks + 1);
  if (batch->last_only && own->tick < batch->arms->ticks) return;
  for (int i = 0; i < NX; ++i) to[(batch->last_only ? 0 : own->tick * NX) + i] = LANE(group->x[i], j);
}

/* Give a lane the next arm that has a tick to make, or none. */
static void take_arm(const scene_t* scene, const batch_t* batch, group_t* group, int j) {
  lane_t* own = group->lane + j;
  do {
    own->arm = group->waiting;
    if (own->arm >= batch->last) return;
    ++group->waiting;
    own->tick = 0;
    own->begins = 1;
    own->at.step = 0.0;
    for (int i = 0; i < NX; ++i) LANE(group->x[i], j) = batch->arms->x0[own->arm * NX + i];
    for (int i = 0; i < NP; ++i) LANE(group->p[i], j) = batch->arms->p[own->arm * batch->arms->p_arm + i];
    store(scene, batch, group, j);
  } while (!batch->arms->ticks);
}

static void begin_tick(const scene_t* scene, const batch_t* batch, group_t* group, int j, const real* acted) {
  lane_t* own = group->lane + j;
  own->begins = 0;
  own->tried = 0;
  own->at = first_substep(batch->arms->h, own->at.step);
  for (int i = 0; i < NU; ++i) LANE(group->u[i], j) = LANE(acted[i], j);
  for (int i = 0; batch->effort && i < NU; ++i)
    batch->effort[(own->arm * batch->arms->ticks + own->tick) * NU + i] = LANE(acted[i], j);
}

/* Find what acts in the ticks that begin. */
static void begin_ticks(const scene_t* scene, const batch_t* batch, group_t* group) {
  real acted[NU];
  int any = 0;
  for (int j = 0; j < LANES; ++j) {
    const lane_t* own = group->lane + j;
    if (own->arm >= batch->last || !own->begins) continue;
    const double* r = batch->arms->tau + own->arm * batch->arms->tau_arm + own->tick * batch->arms->tau_tick;
    for (int i = 0; i < NR; ++i) LANE(group->r[i], j) = r[i];
    any = 1;
  }
  if (!any) return;
  CALL(scene->actuate, (group->x, group->r), (acted));
  for (int j = 0; j < LANES; ++j)
    if (group->lane[j].arm < batch->last && group->lane[j].begins) begin_tick(scene, batch, group, j, acted);
}

/* Accept an attempt of a lane, or not. */
static void end_attempt(const scene_t* scene, const batch_t* batch, group_t* group, int j, const real* next, double error) {
  lane_t* own = group->lane + j;
  const enum outcome outcome =
      control_step(scene, &own->at, batch->arms->h, error / scene->tolerance, is_lane_within_reach(scene, next, j));
  const int accepted = outcome == ACCEPTED || outcome == ENDED;
  const int meets = accepted && meets_any_stop(scene, group->x, next, own->at.trial, 0, j);
  if (accepted)
    for (int i = 0; i < NX; ++i) LANE(group->x[i], j) = LANE(next[i], j);
  const int exhausted = ++own->tried == scene->most_substeps && outcome != ENDED;
  if (outcome == STEP_TOO_SMALL || exhausted || meets) {
    batch->arms->unfinished[own->arm] = 1;
    take_arm(scene, batch, group, j);
  } else if (outcome == ENDED) {
    ++own->tick;
    own->begins = 1;
    store(scene, batch, group, j);
    if (own->tick == batch->arms->ticks) take_arm(scene, batch, group, j);
  }
}

/* Whether a lane has an arm. */
static int any_lane_has_arm(const batch_t* batch, const group_t* group) {
  int any = 0;
  for (int j = 0; j < LANES; ++j) any |= group->lane[j].arm < batch->last;
  return any;
}

/* As `rollout` of rollout.c; an arm is marked, too, that cannot be advanced. */
EXPORTED void controlled_rollout(const scene_t* scene, const arms_t* arms, long long first, long long last, double* out,
                                 int last_only, double* effort) {
  const batch_t batch = {arms, last, out, last_only, effort};
  real next[NX], x[NX], r[NR], u[NU], tunable[NP + 1], error, error_q;
  group_t group = {.waiting = first, .x = x, .r = r, .u = u, .p = tunable, .length = arms->h};
  clear(r, NR);
  clear(u, NU);
  for (int j = 0; j < LANES; ++j) { /* what a lane without an arm computes does not matter */
    for (int i = 0; i < NX; ++i) LANE(group.x[i], j) = arms->x0[first * NX + i];
    for (int i = 0; i < NP; ++i) LANE(group.p[i], j) = arms->p[first * arms->p_arm + i];
  }
  for (int j = 0; j < LANES; ++j) take_arm(scene, &batch, &group, j);
  while (!is_halted(arms) && any_lane_has_arm(&batch, &group)) {
    begin_ticks(scene, &batch, &group);
    for (int j = 0; j < LANES; ++j)
      if (group.lane[j].arm < last) LANE(group.length, j) = next_length(&group.lane[j].at, arms->h);
    CALL(scene->attempt, (group.x, group.u, group.p, &group.length), (next, &error, &error_q));
    for (int j = 0; j < LANES; ++j)
      if (group.lane[j].arm < last) end_attempt(scene, &batch, &group, j, next, LANE(error, j));
  }
}
