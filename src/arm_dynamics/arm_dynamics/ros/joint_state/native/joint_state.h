/* SPDX-License-Identifier: Apache-2.0
 *
 * JointStates that are received and published in C. Python reads this header (joint_state_library.py), and sets the
 * offsets of numbers and the bytes that are constant in all messages of a kind.
 */
#pragma once
#include <rcl/publisher.h>
#include <rcl/subscription.h>
#include <stdint.h>

#include "entry.h"

#define GIGA 1000000000LL

enum {
  KINDS = 4, /* number of known kinds, for several publishers on one topic */
  STAMP = 4, /* offset of the stamp, after the header */
  GID = 16   /* bytes by which the middleware identifies a publisher */
};

/* Outcome of reading a message. */
enum { NONE, KNOWN, BEYOND, OTHER, FAILED };

/* A joint that follows another: its numbers are factor · leader's + offset. */
typedef struct {
  int64_t index, leader;       /* its own and the leader's, in the arrays */
  double factor[3], offset[3]; /* by array */
  double within;               /* deviation that agrees, relative to the larger of the number and 1 */
} follower_t;

/* A kind of message: those of one sender that name the same joints. */
typedef struct {
  const uint8_t *mask, *bits;       /* mask of the bits that are constant in this kind, and their values */
  int64_t size;                    /* bytes up to the last number; 0: unused */
  int64_t at[3];                   /* offsets of the arrays to be read; negative: absent */
  const int64_t* index;            /* of each joint in them; negative: absent */
  const follower_t* followers;     /* joints beside these that must agree with them */
  int64_t follower_count;
} kind_t;

/* The known kinds, and the newest message. */
typedef struct {
  kind_t kinds[KINDS];
  int64_t fields, joints; /* number of arrays to be read, and of numbers in each */
  const double* limit;    /* largest magnitudes of the first array; NULL: unlimited */
  int64_t gaps;           /* whether numbers and arrays may be missing (read as NaN) */
  const uint8_t* raw;     /* the serialized message, and its length */
  int64_t length;
  int64_t stamp, arrival; /* in [ns]: of its header, and when the middleware received it */
  int64_t kind;           /* index of its kind */
  double* numbers;        /* room for its arrays, one after another */
  uint8_t sender[GID];    /* its publisher */
} joint_state_t;

/* Memory for the messages of a subscription. */
typedef struct source source_t;

/* A message in which only the stamp and some arrays change. */
typedef struct {
  uint8_t* raw;
  int64_t size, fields, joints, at[3]; /* bytes, arrays, numbers in each, and offsets of these */
  const uint8_t* numbers[3];           /* sources of the arrays */
  const rcl_publisher_t* publisher;
} sink_t;

/* Read a message: stamp, kind and numbers. KNOWN: its kind is known, and its numbers are finite; BEYOND: likewise, and a
 * number exceeds its limit; else OTHER. */
EXPORT int64_t joint_state_read(joint_state_t* s, const uint8_t* raw, int64_t length);

/* Memory for messages of a subscription; NULL: out of memory. `joint_state_source_free` frees it. */
EXPORT source_t* joint_state_source(const rcl_subscription_t* subscription);
EXPORT void joint_state_source_free(source_t* s);

/* Take the next message, if there is one, and read it. OTHER: `raw` must be evaluated before the next call. */
EXPORT int64_t joint_state_take(source_t* from, joint_state_t* s);

/* The identifier of a publisher, after a pointer; returns 0 or an error code. */
QUICK int64_t publisher_gid(const rcl_publisher_t* publisher, rmw_gid_t* gid);

/* Publish the message with this stamp in [ns] and the current numbers; returns 0 or an error code. */
EXPORT int64_t joint_state_send(sink_t* s, int64_t stamp);

/* Publish a serialized message, whose header gets this stamp in [ns]; returns 0 or an error code. */
rcl_ret_t publish_serialized(const rcl_publisher_t* publisher, uint8_t* raw, int64_t size, int64_t stamp);
