/* SPDX-License-Identifier: Apache-2.0
 *
 * Many arms under error control, LANES at a time. Only attempts are made side by side: every lane has ticks and sub-steps
 * of its own, and takes the next arm when it is done with one.
 */

#include "lanes/lanes.h"
#include "motion/step_control.h"

/* An arm in a lane, and its tick and sub-step.
 *
 * attempts: at sub-steps of this tick
 * has_arm:  0 if no arm is left for this lane
 * is_due:   whether a tick begins
 */
typedef struct {
  long long arm, tick, attempts;
  int has_arm, is_due;
  substeps_t substeps;
} lane_t;

/* The arguments of `adaptive_rollout`, and the arms that are advanced side by side.
 *
 * next_arm:   the first arm that no lane has had
 * busy_lanes: number of lanes that have an arm
 * x:          states at the beginning of the sub-step
 * r:          inputs
 * u:          what acts
 * p:          tunable numbers
 */
typedef struct {
  const arms_t* arms;
  long long last, next_arm;
  double *out, *effort;
  int last_only, busy_lanes;
  lane_t lane[LANES];
  real *x, *r, *u, *p, length;
} adaptive_group_t;

/* Store the state of a lane's arm, unless only the last one is asked for. */
static void store(const scene_t* scene, const adaptive_group_t* group, int j) {
  const lane_t* own = group->lane + j;
  double* to = group->out + own->arm * NX * (group->last_only ? 1 : group->arms->ticks + 1);
  if (group->last_only && own->tick < group->arms->ticks) return;
  for (int i = 0; i < NX; ++i) to[(group->last_only ? 0 : own->tick * NX) + i] = LANE(group->x[i], j);
}

/* Give a lane the next arm that has a tick to make, if there is one. */
static void take_arm(const scene_t* scene, adaptive_group_t* group, int j) {
  lane_t* own = group->lane + j;
  do {
    own->arm = group->next_arm++;
    own->has_arm = own->is_due = own->arm < group->last;
    if (!own->has_arm) {
      --group->busy_lanes;
      return;
    }
    own->tick = 0;
    own->substeps.step = 0.0;
    for (int i = 0; i < NX; ++i) LANE(group->x[i], j) = group->arms->x0[own->arm * NX + i];
    for (int i = 0; i < NP; ++i) LANE(group->p[i], j) = group->arms->p[own->arm * group->arms->p_arm + i];
    store(scene, group, j);
  } while (!group->arms->ticks);
}

/* Begin the ticks that are due: find what acts in them. */
static void begin_due_ticks(const scene_t* scene, adaptive_group_t* group) {
  const arms_t* arms = group->arms;
  real acted[NU];
  int any = 0;
  for (int j = 0; j < LANES; ++j) {
    const lane_t* own = group->lane + j;
    if (!own->is_due) continue;
    const double* r = arms->tau + own->arm * arms->tau_arm + own->tick * arms->tau_tick;
    for (int i = 0; i < NR; ++i) LANE(group->r[i], j) = r[i];
    any = 1;
  }
  if (!any) return;
  CALL(scene->actuate, (group->x, group->r), (acted));
  for (int j = 0; j < LANES; ++j) {
    lane_t* own = group->lane + j;
    if (!own->is_due) continue;
    own->is_due = 0;
    own->attempts = 0;
    own->substeps = first_substep(arms->h, own->substeps.step);
    for (int i = 0; i < NU; ++i) LANE(group->u[i], j) = LANE(acted[i], j);
    for (int i = 0; group->effort && i < NU; ++i)
      group->effort[(own->arm * arms->ticks + own->tick) * NU + i] = LANE(acted[i], j);
  }
}

/* Accept an attempt of a lane, or not. */
static void end_attempt(const scene_t* scene, adaptive_group_t* group, int j, const real* next, double error) {
  lane_t* own = group->lane + j;
  const enum outcome outcome =
      control_step(scene, &own->substeps, group->arms->h, error / scene->tolerance, is_lane_within_reach(scene, next, j));
  const int accepted = outcome == ACCEPTED || outcome == ENDED;
  const int is_near_stop = accepted && meets_any_stop(scene, group->x, next, own->substeps.trial, 0, j);
  if (accepted)
    for (int i = 0; i < NX; ++i) LANE(group->x[i], j) = LANE(next[i], j);
  const int exhausted = ++own->attempts == scene->substep_limit && outcome != ENDED;
  if (outcome == STEP_TOO_SMALL || exhausted || is_near_stop) {
    group->arms->unfinished[own->arm] = 1;
    take_arm(scene, group, j);
  } else if (outcome == ENDED) {
    ++own->tick;
    own->is_due = 1;
    store(scene, group, j);
    if (own->tick == group->arms->ticks) take_arm(scene, group, j);
  }
}

/* As `rollout` of rollout.c; an arm is marked, too, that cannot be advanced. */
EXPORTED void adaptive_rollout(const scene_t* scene, const arms_t* arms, long long first, long long last, double* out,
                               int last_only, double* effort) {
  real next[NX], x[NX], r[NR], u[NU], tunable[NP + 1], error, error_q;
  adaptive_group_t group = {
      .arms = arms, .last = last, .out = out, .effort = effort, .last_only = last_only, .busy_lanes = LANES};
  group.next_arm = first;
  group.x = x;
  group.r = r;
  group.u = u;
  group.p = tunable;
  group.length = arms->h;
  clear(r, NR);
  clear(u, NU);
  for (int j = 0; j < LANES; ++j) { /* what a lane without an arm computes does not matter */
    for (int i = 0; i < NX; ++i) LANE(group.x[i], j) = arms->x0[first * NX + i];
    for (int i = 0; i < NP; ++i) LANE(group.p[i], j) = arms->p[first * arms->p_arm + i];
  }
  for (int j = 0; j < LANES; ++j) take_arm(scene, &group, j);
  while (!is_halted(arms) && group.busy_lanes) {
    begin_due_ticks(scene, &group);
    for (int j = 0; j < LANES; ++j)
      if (group.lane[j].has_arm) LANE(group.length, j) = next_length(&group.lane[j].substeps, arms->h);
    CALL(scene->attempt, (group.x, group.u, group.p, &group.length), (next, &error, &error_q));
    for (int j = 0; j < LANES; ++j)
      if (group.lane[j].has_arm) end_attempt(scene, &group, j, next, LANE(error, j));
  }
}
