/* SPDX-License-Identifier: Apache-2.0
 *
 * Time in a sim node: latencies, stamps and deadlines, each of which Python explains in ros/timing. Python reads this header,
 * see node_library.py. All times are in [ns].
 */
#pragma once
#include <rcl/time.h>
#include <stdint.h>
#include <time.h>

#include "entry.h"

#define GIGA 1000000000LL /* nanoseconds in a second, as in joint_state.h */

/* --- histogram.Histogram, round_trip.RoundTrip ------------------------------------------------------------------------- */

enum {
  FINE_BINS = 20000, /* bins of a microsecond */
  COARSE_BINS = 512, /* bins beyond, of increasing width */
  BINS_PER_OCTAVE = 32,   /* of them per factor of two */
  SENT_STATES = 256    /* number of states whose answers are awaited; answers to older ones are not counted */
};

/* Durations: exact to a microsecond up to 20 ms, to two percent up to 20 minutes. */
typedef struct {
  int64_t* bins;
  int64_t longest;
} histogram_t;

/* Time from a joint state to the command with its stamp. `newest`: stamp of the state published last; `acting`: stamp of the
 * state whose answer acts, 0: none; `oldest`: oldest age at which an answer acted, in [ns]. */
typedef struct {
  int64_t newest, acting, oldest, next; /* index of the next state in the ring buffer */
  int64_t *stamps, *times; /* stamps, -1: answered; system times of publication */
  histogram_t* trips;
} trip_t;

QUICK void histogram_count(histogram_t* h, int64_t duration);

/* Register that the state of this stamp is published now. */
QUICK void trip_register_state(trip_t* t, int64_t stamp);

/* Register that a command for the state of this stamp arrived at this time of the system; only the first one counts. The
 * command before it has acted until the newest state. Returns whether the stamp is that of the newest state. */
QUICK int64_t trip_register_answer(trip_t* t, int64_t stamp, int64_t arrival);

/* --- stamps.NodeTime, where the rules are explained --------------------------------------------------------------- */

/* What stamps depend on; see NodeTime for the rules. */
typedef struct {
  int64_t tick;        /* length of a tick if ticks are due at even times, else 0 */
  rcl_clock_t* foreign; /* the node's clock if it is another node's simulated time, else NULL */
  int64_t even;        /* whether stamps are simulated time plus an offset */
  int64_t free;        /* whether the next stamp is the time when its tick is due, whatever the offset was */
  int64_t simulated;   /* simulated time of the last stamp */
  int64_t last;        /* the last stamp */
  int64_t offset;      /* stamp of simulated time zero */
  int64_t min_lag, next_check; /* lag since the last check, and time of the next one */
  int64_t owed;        /* lag that remains to be recovered */
  const int64_t* due;  /* time of the monotonic clock when the current tick was due; 0: unknown */
} times_t;

/* The stamp of a state from its simulated time, and times of the node's and of the monotonic clock, read in this
 * order: if the thread is stopped between the two, no stamp is later than it should be. */
QUICK int64_t times_stamp_at(times_t* t, int64_t simulated, int64_t now, int64_t steady);

/* The stamp of a state that is published now, from its simulated time. */
int64_t times_stamp_now(times_t* t, int64_t simulated);

/* --- realtime_loop.RealtimeLoop, where the rules are explained ---------------------------------------------------- */

/* When ticks are due; see RealtimeLoop for the rules. */
typedef struct {
  int64_t deadline;  /* of the next tick */
  int64_t earliest;  /* start of the next tick */
  int64_t period;    /* time between deadlines; 0: there are none */
  int64_t spacing;   /* shortest time between ticks */
  int64_t longest_lag; /* lag beyond which deadlines are dropped, skipped or shifted */
  int64_t slow_down; /* whether they are shifted */
  int64_t missed;    /* ticks that began after the next one was due */
  int64_t dropped;   /* deadlines that were dropped, skipped or shifted */
  int64_t ended;     /* nonzero: no more ticks */
  int64_t current;   /* deadline of the tick that was begun last; 0: there is none */
  int64_t began;     /* time at which the last tick began */
  double share;      /* part of a period by which the last tick made time pass */
  histogram_t* lateness; /* delays of ticks after their deadlines */
} due_t;

/* When the next tick may begin. */
QUICK int64_t due_next_start(const due_t* d);

/* A tick begins now: count its lateness, and set the next deadline. */
QUICK void due_begin_tick(due_t* d, int64_t now);

/* Sleep until the next tick, and begin it. */
EXPORT void due_await_tick(due_t* d);

/* --- for ticks.c -------------------------------------------------------------------------------------------------- */

int64_t time_of(clockid_t clock);
