/* SPDX-License-Identifier: Apache-2.0
 *
 * Modes of joints and contacts, and what is recorded of a tick for its derivatives.
 *
 * Arrays may have no elements, see prediction.h. 
 */

#pragma once
#include "scene.h"

/* Entries of p for a contact, as numbers for the generated functions. Python: ContactMode; equations/contact.py: Mode. */
typedef struct {
  real closed;    /* 1 if it is closed, 0 if it is open */
  real sticks;    /* 1 if a closed one sticks, 0 if it slides */
  real along[2];  /* direction of sliding in the two tangents */
  real fixed;     /* 1 if it keeps that direction, 0 if the direction follows the motion */
} contact_mode_t;

/* The vector p of the generated functions. Python: Modes. */
__extension__ typedef struct {
  real tunable[NP];
  real direction[ND]; /* of joints: -1 and 1 slide, 0 is held by friction or a stop; without friction sliding is 1 */
  real pressed[NQ];   /* of joints: -1 and 1 press against the lower and the upper compliant stop, else 0 */
  real switches[NK];  /* of drives and cords: 1 where a comparison holds, else 0 */
  contact_mode_t contact[NC];
} modes_t;

/* A segment of a tick, for derivatives; all entries are real numbers. */
__extension__ typedef struct {
  real before[NX], begin[NX], end[NX]; /* states before its impact, after it, and at the end of its motion */
  modes_t p;
  real limit[NC];         /* fraction of its normal force up to which a contact sticks */
  real length, steps;     /* length of its motion, and number of its steps */
  real event_free;              /* 1 if no event ended it */
  real off;               /* largest change of positions and velocities by closing its contacts afterwards */
  real hit, part;         /* 1 if it began with an impact, and the fraction of the full rebound */
  real meets[ND];         /* 0 for joints that took part in the impact at their stops */
  real leaves[NU];        /* velocities after the impact */
  real rebound[NC], impulse[3 * NC]; /* of contacts: velocities after the impact, impulses */
} record_t;

/* A traced tick. */
typedef struct {
  record_t* records; /* of its segments ... */
  double* steps;     /* ... and the lengths of their steps, one after the other */
  long long most, most_steps; /* room for both ... */
  long long count, taken;     /* ... and how many there were, even if there was room for fewer */
  long long time_stepped; /* whether its end was time-stepped */
} trace_t;
