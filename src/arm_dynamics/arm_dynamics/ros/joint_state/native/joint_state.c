/* SPDX-License-Identifier: Apache-2.0
 *
 * Reception and publication of JointStates, each in a single call, for loops at 1 kHz. The offsets of numbers, and the
 * bytes that are constant in all messages of a kind, are set by sink.py and reader.py.
 */
#include "joint_state.h"

#include <math.h>
#include <rcutils/error_handling.h>
#include <rmw/rmw.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(GID == RMW_GID_STORAGE_SIZE, "identifiers of publishers");

#define ROOM 65536 /* bytes kept for messages; the memory of a larger one is freed before the next is taken */

struct source {
  const rcl_subscription_t* subscription;
  rcl_serialized_message_t message;
};

/* Whether a message is of a kind: its constant bits are as expected. */
static int is_of(const kind_t* kind, const uint8_t* raw, int64_t length) {
  uint8_t differs = 0;
  if (!kind->size || length < kind->size) return 0;
  for (int64_t i = 0; i < kind->size; ++i) differs |= (raw[i] ^ kind->bits[i]) & kind->mask[i];
  return !differs;
}

/* Whether the numbers of a message's followers agree with their leaders', or are missing. */
static int followers_agree(const joint_state_t* s, const kind_t* kind, const uint8_t* raw) {
  for (const follower_t* follower = kind->followers; follower < kind->followers + kind->follower_count; ++follower)
    for (int64_t f = 0; f < s->fields; ++f) {
      double own, leader;
      if (kind->at[f] < 0) continue;
      memcpy(&own, raw + kind->at[f] + 8 * follower->index, 8);
      memcpy(&leader, raw + kind->at[f] + 8 * follower->leader, 8);
      double expected = follower->offset[f] + (follower->factor[f] != 0.0 ? follower->factor[f] * leader : 0.0);
      if (!isnan(own) && !(fabs(own - expected) <= follower->within * fmax(1.0, fabs(expected)))) return 0;
    }
  return 1;
}

int64_t joint_state_read(joint_state_t* s, const uint8_t* raw, int64_t length) {
  const kind_t* kind = s->kinds;
  while (!is_of(kind, raw, length))
    if (++kind == s->kinds + KINDS) return OTHER;
  s->kind = kind - s->kinds;
  int32_t seconds;
  uint32_t nanoseconds;
  memcpy(&seconds, raw + STAMP, 4);
  memcpy(&nanoseconds, raw + STAMP + 4, 4);
  s->stamp = GIGA * seconds + nanoseconds;
  int is_beyond = 0;
  for (int64_t f = 0; f < s->fields; ++f)
    for (int64_t i = 0; i < s->joints; ++i) {
      double number = NAN;
      if (kind->index[i] < 0) continue;
      if (kind->at[f] >= 0) memcpy(&number, raw + kind->at[f] + 8 * kind->index[i], 8);
      if (!isfinite(number) && !(s->gaps && isnan(number))) return OTHER;
      s->numbers[f * s->joints + i] = number;
      is_beyond |= f == 0 && s->limit && fabs(number) > s->limit[i];
    }
  if (kind->follower_count && !followers_agree(s, kind, raw)) return OTHER;
  return is_beyond ? BEYOND : KNOWN;
}

source_t* joint_state_source(const rcl_subscription_t* subscription) {
  source_t* s = calloc(1, sizeof *s);
  if (!s) return NULL;
  s->subscription = subscription;
  s->message.allocator = rcutils_get_default_allocator();
  return s;
}

void joint_state_source_free(source_t* s) {
  s->message.allocator.deallocate(s->message.buffer, s->message.allocator.state);
  free(s);
}

int64_t joint_state_take(source_t* from, joint_state_t* s) {
  rcl_serialized_message_t* m = &from->message;
  rmw_message_info_t about;
  if (m->buffer_capacity > ROOM) {
    m->allocator.deallocate(m->buffer, m->allocator.state);
    m->buffer = NULL;
    m->buffer_capacity = 0;
  }
  m->buffer_length = 0;
  rcl_ret_t result = rcl_take_serialized_message(from->subscription, m, &about, NULL);
  if (result != RCL_RET_OK) {
    rcutils_reset_error();
    return result == RCL_RET_SUBSCRIPTION_TAKE_FAILED ? NONE : FAILED;
  }
  s->raw = m->buffer;
  s->length = m->buffer_length;
  memcpy(s->sender, about.publisher_gid.data, GID);
  s->arrival = about.received_timestamp;
  return joint_state_read(s, m->buffer, m->buffer_length);
}

int64_t publisher_gid(const rcl_publisher_t* publisher, rmw_gid_t* gid) {
  return rmw_get_gid_for_publisher(rcl_publisher_get_rmw_handle(publisher), gid);
}

rcl_ret_t publish_serialized(const rcl_publisher_t* publisher, uint8_t* raw, int64_t size, int64_t stamp) {
  int64_t rest = (stamp % GIGA + GIGA) % GIGA;
  int32_t seconds = (int32_t)((stamp - rest) / GIGA);
  uint32_t nanoseconds = (uint32_t)rest;
  memcpy(raw + STAMP, &seconds, 4);
  memcpy(raw + STAMP + 4, &nanoseconds, 4);
  rcl_serialized_message_t message = {.buffer = raw, .buffer_length = size, .buffer_capacity = size};
  rcl_ret_t result = rcl_publish_serialized_message(publisher, &message, NULL);
  if (result != RCL_RET_OK) rcutils_reset_error();
  return result;
}

int64_t joint_state_send(sink_t* s, int64_t stamp) {
  for (int64_t f = 0; f < s->fields; ++f) memcpy(s->raw + s->at[f], s->numbers[f], 8 * s->joints);
  return publish_serialized(s->publisher, s->raw, s->size, stamp);
}
