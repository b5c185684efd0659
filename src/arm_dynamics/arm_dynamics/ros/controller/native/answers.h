/* SPDX-License-Identifier: Apache-2.0
 *
 * Ordinary answers of the controller. Python reads this header, see compiled_answers.py, jumps.py, answer_log.py,
 * tolerances.py and tracking.py.
 */
#pragma once
#include "joint_state.h"

enum { ENDED = -1 }; /* else `receiver_serve` returns the outcome of `joint_state_take` for a state that Python must answer */

/* Publishers of states: the one that is followed, another one, and times in [ns] of their last states; 0: none. */
typedef struct {
  uint8_t sender[GID], other[GID];
  int64_t last_time, other_time;
} publishers_t;

/* The previous state; `valid` 0: there is none. `longest`: longest time in [ns] between two states since Python looked. */
typedef struct {
  int64_t valid, stamp, longest;
  double *q, *v;
} state_t;

/* What happened between two states: time or the arm moved on, or jumped. */
enum { STEADY, BACKWARDS, PAUSED, MOVED };

/* Compare a state of n joints with the previous one. A jump is time that goes backwards, or advances by more than `gap` in
 * [s] (PAUSED), or a joint that moves farther than `far` beyond twice the distance that its speeds explain; 0: any time,
 * any distance. Returns one of these, or MOVED plus the index of the joint. */
QUICK int64_t find_jump(const state_t* b, int64_t n, int64_t stamp, const double* q, const double* v, double gap, double far);

/* Make a state the previous one. */
QUICK void note_state(state_t* b, int64_t n, int64_t stamp, const double* q, const double* v);

/* The state that was answered last, byte for byte; length 0: its answer cannot be repeated. */
typedef struct {
  uint8_t* raw;
  int64_t length, room;
} last_message_t;

/* Whether a state repeats the one that was answered last. */
QUICK int64_t is_repeated(const last_message_t* last, const uint8_t* raw, int64_t length);

/* Remember a state, for which there is room. */
QUICK void remember_state(last_message_t* last, const uint8_t* raw, int64_t length);

/* Largest errors of the joints. */
typedef struct {
  const double *position, *velocity;
  const int64_t* turning; /* nonzero for joints without position limits, whose errors are the shortest rotations */
} tolerance_t;

/* Errors of n positions and n velocities, reference less measured. `motion`: q and v, and the reference's q and v (4n). */
QUICK void find_errors(const double* motion, int64_t n, const int64_t* turning, double* errors);

/* Whether the errors of a motion, as of `find_errors`, are within tolerances. */
QUICK int64_t is_within(const double* motion, int64_t n, const tolerance_t* allowed);

/* The tracking state, a message in which only the stamp and the numbers change. */
enum { ARRAYS = 8 };
typedef struct {
  const rcl_publisher_t* publisher;
  int64_t due, period; /* stamp from which the next one is due, and time between two in [ns] */
  uint8_t* raw;
  int64_t size, at[ARRAYS + 1]; /* offsets of the arrays and of the remaining time */
  /* The motion that was accepted last: stamp at which it begins, and duration in [s]. */
  int64_t start;
  double duration;
} report_t;

/* Publish the tracking state, if that is due and someone listens; returns 0 or an error code, and then the next state is
 * due. `motion`: q and v, and the reference's q, v and a (5n). */
EXPORT int64_t report_publish(report_t* r, int64_t stamp, int64_t n, const double* motion, const double* torque);

/* All that an answer depends on or changes. */
typedef struct {
  int64_t active; /* whether C may answer; false after every change in Python */
  int64_t interrupt; /* nonzero: Python answers the next state */
  source_t* source;
  joint_state_t* reader;
  publishers_t* publishers;
  sink_t* sink;
  int64_t joints;
  int64_t until; /* stamp from which Python answers states */
  report_t* report;
  /* The controller: its input (6n: q, v and the reference's q, v, a, torques), output and limit (NULL: none). */
  const entry_t* law;
  double* input;
  const double *torque, *limit;
  /* The memory of the controller: before and after a call, and how many numbers. */
  double* memory;
  const double* next_memory;
  int64_t memory_size;
  /* Commands: gain times torque plus back_emf times velocity; NULL: the torque itself. */
  const double *gain, *back_emf;
  double* command;
  /* The motion: stamp at which it begins, number of segments, and the rest as for `trajectory_sample`. */
  int64_t start, segments;
  const double *knots, *polynomials, *ends, *torques;
  /* Path tolerances and the stamp from which they apply; NULL: none. */
  int64_t path_begin;
  const tolerance_t* path;
  /* Largest time [s] and distance from one state to the next; 0: any. */
  double gap_limit, jump_limit;
  /* The previous state, its torque, and its bytes. */
  state_t* previous;
  double* tau;
  last_message_t* last_message;
  /* Answers so far, time of the last one, total and longest time of an answer in [ns]. */
  int64_t count, last_time, total_time, longest_time;
} answers_t;

/* Passes states from ROS to the thread that answers them. */
typedef struct receiver receiver_t;

/* A receiver of the messages of a subscription; NULL: out of memory, or ROS does not report new messages. */
EXPORT receiver_t* receiver_create(const rcl_subscription_t* subscription);

/* Answer states until Python must answer one; returns the outcome of `joint_state_take` for it, or ENDED after
 * `receiver_end`. Called by one thread, which holds the lock before and after, but not while it waits. With `direct`, the
 * thread of the middleware that brings a state answers it at once where possible. */
EXPORT int64_t receiver_serve(receiver_t* r, answers_t* a, int64_t direct);

/* Let `receiver_serve` return. */
EXPORT void receiver_end(receiver_t* r);

/* Locks for Python; they may be nested. */
EXPORT void receiver_lock(receiver_t* r);
EXPORT void receiver_unlock(receiver_t* r);

/* Free the memory; nothing may be using it. */
EXPORT void receiver_free(receiver_t* r);
