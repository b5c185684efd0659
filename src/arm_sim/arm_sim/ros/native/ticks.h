/* SPDX-License-Identifier: Apache-2.0
 *
 * The ticks of a sim node. Every tick is made here: by a caller, by the clock, or when its state has been answered. What
 * C cannot do it asks Python for, by one function. Python reads this header, see ticks.py.
 */
#pragma once
#include "arm.h"
#include "joint_state.h"
#include "record.h"
#include "timing.h"

/* What Python is asked for, in the order of a tick. */
enum {
  SERVE,   /* run the queue */
  READ,    /* process a message, see `outcome`; whether no newer one is expected */
  IDLE,    /* time stands still */
  PREPARE, /* put the delayed command that has arrived, set the torques of wrenches */
  EXPIRE,  /* a command becomes stale: whether it goes on acting, since the next one may be arriving */
  MOVE,    /* a tick under `actor`, other than efforts; whether it can be computed */
  SENSE,   /* after a tick that C made: sample the sensors, notice a clipped command */
  FILL,    /* fill the arrays of the joint state that C does not compute */
  UNSENT,  /* the joint state could not be published */
  SPACE,   /* make space in the recording for `needed_space` bytes; whether there is any */
  TICKED   /* notify listeners of the tick */
};

/* --- latest.LatestCommand: the newest command, or the policy -------------------------------------------------------- */

/* What acts: efforts; a command of the servos, which Python keeps; or a policy. */
enum { NOTHING, EFFORTS, JOINTS, BRAKE, SERVO, ZERO, HOLD, GRAVITY };

/* The newest command. */
typedef struct {
  int64_t kind;     /* what it is for; NOTHING: none has arrived */
  int64_t fresh;    /* whether it has not acted yet */
  int64_t lasting;  /* whether it never becomes stale */
  int64_t was_sent; /* whether a command was sent since the last reset */
  int64_t unread;   /* whether Python has not read its efforts yet */
  double age;       /* ticks since it was first used */
  int64_t timeout, policy;
  int64_t stale, stale_count; /* whether the policy acts because commands have stopped, and how often it began to */
  int64_t extended;           /* ticks for which commands acted beyond their time */
  double* efforts;
} slot_t;

/* What acts in a tick that does not make the command older. */
QUICK int64_t slot_actor(const slot_t* s);

/* Whether the command that acts is too old for a tick, or the part of one, that makes it older. */
QUICK int64_t slot_expires(const slot_t* s, double share);

/* What acts in the next tick, which is counted; `extend`: the command goes on acting, whatever its age. */
QUICK int64_t slot_choose(slot_t* s, double share, int64_t extend);

/* --- arbiter.Arbiter ------------------------------------------------------------------------------------------------- */

/* A source of commands: time of the last command, and number of commands without a silence. */
typedef struct {
  double last_time;
  int64_t count;
} stream_t;

/* Whether a source has commanded within the last `patience` ticks. */
QUICK int64_t stream_is_remembered(const stream_t* s, double now, int64_t patience);

/* Count a command of a source. */
QUICK void stream_count(stream_t* s, double now, int64_t patience);

/* Who commands, in ticks. */
typedef struct {
  double now; /* ticks so far */
  int64_t patience;
  stream_t* only; /* the only source that is remembered; NULL: there is none, or more than one */
} arbiter_t;

/* --- lockstep.Lockstep -------------------------------------------------------------------------------------------- */

/* The state whose answer is awaited. */
typedef struct {
  int64_t stamp;        /* its stamp; -1: none */
  int64_t published, first; /* when it was published last and first, in time of the monotonic clock */
  int64_t ignored;      /* number of commands that did not answer a waiting state */
  int64_t soon;         /* time within which busy-waiting for an answer pays */
  int64_t end;          /* when other callbacks get their turn */
} waiting_t;

/* What held the arm in a tick, see arm_msgs/Tick. */
enum { FREE, BRAKES, SERVOS };

/* --- ticks ----------------------------------------------------------------------------------------------------------- */

/* All that a tick needs, and what it shares with Python. */
typedef struct {
  int64_t (*ask)(int64_t what);
  int64_t* bell;         /* nonzero: there is something in the queue */
  int64_t broken;        /* nonzero: return to Python, as it has raised an exception, or a tick cannot be computed */
  int64_t paused, waits_for_command; /* whether time stands still, and whether it does until the first command */
  double share;          /* part of a tick by which the next one makes commands older */
  /* Commands: where they come from, and the kinds of messages that Python need not see, as their source commands all joints
   * and is the only one; the outcome of reading a message that Python must process; the stamp of the last message, -1: it was
   * refused. */
  int64_t (*take)(source_t*, joint_state_t*);
  source_t* source;
  joint_state_t* reader;
  int64_t most_messages; /* largest number of messages that are read before a tick */
  int64_t trusted_kinds[KINDS];
  int64_t outcome, stamp;
  arbiter_t* arbiter;
  slot_t* slot;
  int64_t was_stale;
  int64_t needs_preparation; /* whether commands are delayed, or wrenches act */
  /* The arm. */
  arm_t* arm; /* NULL: Python advances it */
  const double *x, *effort;
  int64_t step_count, hold; /* ticks since the last reset; in the last one FREE, BRAKES or SERVOS */
  double dt;
  int64_t joints, states;   /* lengths of efforts, and of x */
  int64_t actor;            /* what acts in a tick that Python makes */
  int64_t stopping, locked; /* whether the arm is being stopped or held, and whether brakes have closed */
  int64_t needs_cut_notice, has_sensors; /* whether a clipped command must be noticed, and whether there are sensors */
  /* Ring buffers for the energy account, which other threads read: states, efforts, and numbers of the ticks (negative: brakes
   * held the arm); their length in rows, 0: nothing is kept; the number of ticks kept so far, and of those that Python has noted. */
  double *state_trail, *effort_trail;
  int64_t *ticks, rows, kept_count, noted_count;
  /* Outputs: ticks between joint states, and between infrequent topics; whether Python is told of every tick; where they go,
   * NULL: nowhere. */
  int64_t state_period, slow_period, has_listeners;
  sink_t *joint_states, *ground_truth, *clock;
  entry_t* drives; /* computes the efforts of joint states; NULL: these are the commands */
  int64_t needs_filling; /* whether Python fills arrays */
  times_t* times; /* NULL: stamps are simulated time */
  trip_t* trip;
  int64_t state_stamp; /* stamp of the last joint state */
  double idle_time; /* real time in [s] since the last joint state, while simulated time stands still */
  /* The recording; NULL: there is none, or no space in it. */
  chunk_t* chunk;
  tick_t* copy;
  int64_t commands; /* number of the channel of commands */
  int64_t recorded_count; /* ticks in it so far */
  int64_t log_time, needed_space; /* time of what is written next, and bytes for which Python must make space */
} ticks_t;

/* Read the messages that have arrived. */
EXPORT void ticks_read_commands(ticks_t* t);

/* A tick, unless time stands still. */
EXPORT void ticks_tick(ticks_t* t);

/* Ticks by the clock, until they end, see RealtimeLoop. */
EXPORT void ticks_by_the_clock(ticks_t* t, due_t* due);

/* The ticks triggered by a command with this stamp, and by those that arrive soon after it, see Lockstep. */
EXPORT void ticks_in_lockstep(ticks_t* t, waiting_t* w, int64_t stamp);

/* Some ticks that do not make the command older; returns how many were made. */
EXPORT int64_t ticks_advance(ticks_t* t, int64_t count);

/* Publish the current state. */
EXPORT void ticks_publish_state(ticks_t* t);
