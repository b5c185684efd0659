/* SPDX-License-Identifier: Apache-2.0
 *
 * JointStates in and out in one call each: what a loop of 1 kHz does with every message. Where numbers stand, and which
 * bytes are the same in all messages of a kind, is told by topics.py.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <rcl/publisher.h>
#include <rcl/subscription.h>
#include <rcutils/error_handling.h>

#define EXPORT __attribute__((visibility("default")))
#define ROOM 65536 /* bytes kept for messages; a larger one gives its memory back before the next is taken */
#define GIGA 1000000000LL
#define KINDS 4 /* known at once, for several publishers on one topic */
#define STAMP 4 /* where the stamp is: after the header */

enum { NONE, KNOWN, BEYOND, OTHER, FAILED };

/* A kind of message: those of one sender that name the same joints. */
typedef struct {
  const uint8_t *fixed, *expected; /* bits that are the same in every message of this kind, and what they are */
  int64_t size;                    /* bytes up to the last number; 0: no kind is here */
  int64_t at[3];                   /* where the arrays to be read begin; negative: one is not there */
  const int64_t* place;            /* of each joint in them; negative: it is absent */
} kind_t;

/* The kinds that are known, and the message looked at last. */
typedef struct {
  kind_t kinds[KINDS];
  int64_t fields, joints; /* arrays to be read, and the numbers of each */
  const double* limit;    /* how large the numbers of the first array may be; NULL: as large as they like */
  uint8_t* found;         /* receives stamp and arrival in [ns] and which kind it is, then the numbers */
  const uint8_t* raw;     /* the message itself, and its length */
  int64_t length;
  int64_t gaps; /* whether numbers, and arrays, may be missing: NaN */
} joint_state_t;

static void put(joint_state_t* s, int64_t place, int64_t value) { memcpy(s->found + 8 * place, &value, 8); }

static int is_of(const kind_t* kind, const uint8_t* raw, int64_t length) {
  uint8_t differs = 0;
  if (!kind->size || length < kind->size) return 0;
  for (int64_t i = 0; i < kind->size; ++i) differs |= (raw[i] ^ kind->expected[i]) & kind->fixed[i];
  return !differs;
}

/* Read a message that is here. KNOWN: its kind is, it is finite, and `found` has been written; BEYOND: likewise, and a
 * number is beyond its limit; else OTHER. */
EXPORT int64_t look(joint_state_t* s, const uint8_t* raw, int64_t length) {
  const kind_t* kind = s->kinds;
  while (!is_of(kind, raw, length))
    if (++kind == s->kinds + KINDS) return OTHER;
  put(s, 2, kind - s->kinds);
  int32_t seconds;
  uint32_t nanoseconds;
  memcpy(&seconds, raw + STAMP, 4);
  memcpy(&nanoseconds, raw + STAMP + 4, 4);
  put(s, 0, GIGA * seconds + nanoseconds);
  int beyond = 0;
  for (int64_t f = 0; f < s->fields; ++f)
    for (int64_t i = 0; i < s->joints; ++i) {
      double number = NAN;
      if (kind->place[i] < 0) continue;
      if (kind->at[f] >= 0) memcpy(&number, raw + kind->at[f] + 8 * kind->place[i], 8);
      if (!isfinite(number) && !(s->gaps && isnan(number))) return OTHER;
      memcpy(s->found + 24 + 8 * (f * s->joints + i), &number, 8);
      beyond |= f == 0 && s->limit && fabs(number) > s->limit[i];
    }
  return beyond ? BEYOND : KNOWN;
}

typedef struct {
  const rcl_subscription_t* subscription;
  rcl_serialized_message_t message;
} source_t;

/* Memory for messages of a subscription; NULL if there is none. `release` gives it back. */
EXPORT source_t* source(const rcl_subscription_t* subscription) {
  source_t* s = calloc(1, sizeof *s);
  if (!s) return NULL;
  s->subscription = subscription;
  s->message.allocator = rcutils_get_default_allocator();
  return s;
}

EXPORT void release(source_t* s) {
  s->message.allocator.deallocate(s->message.buffer, s->message.allocator.state);
  free(s);
}

/* Take the next message, if there is one, and read it. OTHER: look at `raw` before the next call. */
EXPORT int64_t take(source_t* from, joint_state_t* s) {
  rcl_serialized_message_t* m = &from->message;
  rmw_message_info_t about;
  if (m->buffer_capacity > ROOM) {
    m->allocator.deallocate(m->buffer, m->allocator.state);
    m->buffer = NULL;
    m->buffer_capacity = 0;
  }
  m->buffer_length = 0;
  rcl_ret_t done = rcl_take_serialized_message(from->subscription, m, &about, NULL);
  if (done != RCL_RET_OK) {
    rcutils_reset_error();
    return done == RCL_RET_SUBSCRIPTION_TAKE_FAILED ? NONE : FAILED;
  }
  s->raw = m->buffer;
  s->length = m->buffer_length;
  put(s, 1, about.received_timestamp);
  return look(s, m->buffer, m->buffer_length);
}

/* A message of which only the stamp and some arrays change. */
typedef struct {
  uint8_t* raw;
  int64_t size, fields, joints, at[3];
  const uint8_t* numbers[3]; /* what the arrays are written from */
  const rcl_publisher_t* publisher;
} sink_t;

/* Publish the message with this stamp in [ns] and the numbers of now; 0, or why it was not published. */
EXPORT int64_t send(sink_t* s, int64_t stamp) {
  int64_t rest = (stamp % GIGA + GIGA) % GIGA;
  int32_t seconds = (int32_t)((stamp - rest) / GIGA);
  uint32_t nanoseconds = (uint32_t)rest;
  memcpy(s->raw + STAMP, &seconds, 4);
  memcpy(s->raw + STAMP + 4, &nanoseconds, 4);
  for (int64_t f = 0; f < s->fields; ++f) memcpy(s->raw + s->at[f], s->numbers[f], 8 * s->joints);
  rcl_serialized_message_t message = {.buffer = s->raw, .buffer_length = s->size, .buffer_capacity = s->size};
  rcl_ret_t done = rcl_publish_serialized_message(s->publisher, &message, NULL);
  if (done != RCL_RET_OK) rcutils_reset_error();
  return done;
}
