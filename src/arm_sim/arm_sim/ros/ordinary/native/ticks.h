/* SPDX-License-Identifier: Apache-2.0
 *
 * Ordinary ticks. Python reads this header, see ticks.py for the callers.
 */
#pragma once
#include "arm.h"
#include "joint_state.h"
#include "loop.h"
#include "record.h"

/* Reason for returning: Python must execute the next tick; a tick was executed and Python must publish it; no tick is
 * left to Python, which must decide whether to continue; an answer has arrived, and Python must execute its tick. */
enum { LEFT, MADE, DONE, ANSWERED };

typedef struct {
  int64_t* bell; /* nonzero: Python has work between two ticks */
  /* Commands: their source, the admitted controller, and its newest command. */
  source_t* source;
  joint_state_t* reader;
  int64_t at_once;      /* largest number of commands read in a tick */
  int64_t leads[KINDS]; /* kinds of messages whose source commands all joints alone */
  double share; /* part of a tick by which the next one makes commands older */
  /* Of the arbiter: ticks so far, and that source. */
  double now;
  int64_t patience;
  stream_t* stream;
  double age;
  int64_t timeout;
  double* newest;
  int64_t fresh;   /* whether the command is newer than the one known to Python */
  int64_t pending; /* outcome of a message that was taken and that Python must process; NONE: none */
  /* The arm. */
  arm_t* step;
  int64_t joints, states;
  int64_t ticks; /* since the last reset */
  int64_t notice; /* whether clipped commands must be reported */
  entry_t* drives; /* (state, command) -> efforts of joint states; NULL: these are the commands */
  /* States for the energy account, which other threads read: the last ones, the number of ticks kept so far, and of
   * those already noted by Python. Without room they are not kept. */
  double *trail, *acted;
  int64_t room, kept, noted;
  /* Outputs. */
  int64_t every, seldom; /* ticks between joint states, and between those after which Python publishes */
  sink_t *state, *clock; /* NULL: no clock */
  times_t* times;        /* NULL: stamps are simulated time */
  trip_t* trip;
  /* The recording; NULL: there is none. */
  chunk_t* chunk;
  tick_t* copy;
  int64_t commands;     /* number of the channel of commands */
  int64_t recorded;
} ticks_t;

/* Execute ticks by the clock, see RealtimeLoop. With LEFT, a tick has begun that Python must execute. */
EXPORT int64_t by_the_clock(ticks_t* t, due_t* due);

/* Execute the ticks triggered by answers, see Lockstep, as long as these arrive soon. */
EXPORT int64_t in_lockstep(ticks_t* t, waiting_t* w);
