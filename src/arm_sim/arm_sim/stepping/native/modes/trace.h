/* SPDX-License-Identifier: Apache-2.0
 *
 * Modes of joints and contacts, and what is recorded of a tick for its derivatives.
 */

#pragma once
#include "modes/prediction.h"

/* Entries of p for a contact, as numbers for the generated functions. Python: Modes.contact; equations/contact.py: Mode. */
typedef struct {
  real closed;    /* 1 if it is closed, 0 if it is open */
  real sticks;    /* 1 if a closed one sticks, 0 if it slides */
  real along[2];  /* direction of sliding in the two tangents */
  real fixed;     /* 1 if it keeps that direction, 0 if the direction follows the motion */
} contact_mode_t;

/* The vector p of the generated functions. Python: Modes. */
typedef struct {
  real* tunable;   /* numbers of the scene; here the vector begins */
  real* direction; /* of joints: -1 and 1 slide, 0 is held by friction or a stop; without friction sliding is 1 */
  real* pressed;   /* of joints: -1 and 1 press against the lower and the upper compliant stop, else 0 */
  real* switches;  /* of drives and cords: 1 where a comparison holds, else 0 */
  contact_mode_t* contact;
} modes_t;

static modes_t modes_of(const scene_t* scene, real* p) {
  modes_t modes = {p, p + NP, p + NP + ND, p + NP + ND + NQ, (contact_mode_t*)(p + NP + ND + NQ + NK)};
  return modes;
}

/* Declare modes that begin as others. */
#define LOCAL_MODES(name, like) \
  LOCAL(modes_t, name, modes_of, P_LENGTH); \
  copy(name.tunable, (like).tunable, P_LENGTH)

/* A segment of a tick, for derivatives. */
typedef struct {
  real *before, *begin, *end; /* states before its impact, after it, and at the end of its motion */
  modes_t p;
  real* limit;            /* fraction of its normal force up to which a contact sticks */
  real length, steps;     /* length of its motion, and number of its steps */
  int event_free;         /* whether no event ended it */
  real off;               /* largest change of positions and velocities by closing its contacts afterwards */
  int hit;                /* whether it began with an impact, ... */
  real part;              /* ... and the fraction of the full rebound */
  real* meets;            /* 0 for joints that took part in the impact at their stops */
  real* leaves;           /* velocities after the impact */
  real *rebound, *impulse; /* of contacts: velocities after the impact, impulses */
} record_t;
#define RECORD (3 * NX + NP + MODES + NC + ND + NU + 4 * NC)

static record_t record_of(const scene_t* scene, real* numbers) {
  record_t record;
  record.before = numbers;
  record.begin = record.before + NX;
  record.end = record.begin + NX;
  record.p = modes_of(scene, record.end + NX);
  record.limit = record.end + NX + P_LENGTH;
  record.meets = record.limit + NC;
  record.leaves = record.meets + ND;
  record.rebound = record.leaves + NU;
  record.impulse = record.rebound + NC;
  record.length = record.steps = record.off = record.part = 0.0;
  record.event_free = record.hit = 0;
  clear(numbers, RECORD);
  return record;
}

/* A traced tick. */
typedef struct {
  record_t* records; /* of its segments ... */
  double* numbers;   /* ... with their numbers, ... */
  double* steps;     /* ... and the lengths of their steps, one after the other */
  long long most, most_steps; /* room for both ... */
  long long count, taken;     /* ... and how many there were, even if there was room for fewer */
  long long time_stepped; /* whether its end was time-stepped */
} trace_t;
