/* SPDX-License-Identifier: Apache-2.0
 *
 * What is recorded of a tick and its segments, for derivatives.
 */

#pragma once
#include "modes/mode_vector.h"

/* A segment of a tick, for derivatives. */
typedef struct {
  real *before, *begin, *end; /* states before its impact, after it, and at the end of its motion */
  modes_t p;
  real* stick_limit;      /* fraction of its normal force up to which a contact sticks */
  real length;            /* of its motion, ... */
  long long steps;        /* ... and number of its steps */
  int event_free;         /* whether no event ended it */
  real closing_change;    /* largest change of positions and velocities by closing its contacts afterwards */
  int has_impact;         /* whether it began with an impact, ... */
  real rebound_fraction;  /* ... and the fraction of the full rebound */
  real* impact_direction; /* of joints in the impact: 0 where they took part in it at their stops */
  real* leaves;           /* velocities after the impact */
  real *rebound, *impulse; /* of contacts: velocities after the impact, impulses */
} record_t;
#define RECORD (3 * NX + P_LENGTH + NC + ND + NU + 4 * NC)

static record_t record_of(const scene_t* scene, real* numbers) {
  record_t record;
  record.before = numbers;
  record.begin = record.before + NX;
  record.end = record.begin + NX;
  record.p = modes_of(scene, record.end + NX);
  record.stick_limit = record.end + NX + P_LENGTH;
  record.impact_direction = record.stick_limit + NC;
  record.leaves = record.impact_direction + ND;
  record.rebound = record.leaves + NU;
  record.impulse = record.rebound + NC;
  record.length = record.closing_change = record.rebound_fraction = 0.0;
  record.steps = record.event_free = record.has_impact = 0;
  clear(numbers, RECORD);
  return record;
}

/* A traced tick. */
typedef struct {
  record_t* records; /* of its segments ... */
  double* numbers;   /* ... with their numbers, ... */
  double* steps;     /* ... and the lengths of their steps, one after the other */
  long long most, most_steps; /* room for both ... */
  long long count, step_count;     /* ... and how many there were, even if there was room for fewer */
  long long time_stepped; /* whether its end was time-stepped */
} trace_t;
