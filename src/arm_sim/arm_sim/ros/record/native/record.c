/* SPDX-License-Identifier: Apache-2.0
 *
 * Copies a tick, and the joint state published for it, into a message buffer in a single call.
 */
#include "record.h"

#include <string.h>

int64_t has_room(const chunk_t* c, int64_t now, int64_t size) {
  return c->at + size <= c->size && !(c->at && now - c->since > c->oldest);
}

void put_record(chunk_t* c, int64_t channel, int64_t log, int64_t publish, const uint8_t* data, int64_t size) {
  uint8_t* to = c->raw + c->at;
  const uint64_t length = size + HEADER - 9, times[2] = {log, publish};
  const uint16_t number = channel;
  to[0] = 5; /* opcode of a message, and its length behind these two: */
  memcpy(to + 1, &length, 8);
  memcpy(to + 9, &number, 2);
  memset(to + 11, 0, 4);
  memcpy(to + 15, times, 16);
  memcpy(to + HEADER, data, size);
  if (!c->at) c->since = log;
  c->places[c->count++] = c->at;
  c->at += HEADER + size;
}

void record(chunk_t* c, tick_t* t, int64_t now, int64_t stamp, int64_t hold, const uint8_t* state, int64_t size,
            int64_t state_stamp) {
  const int32_t seconds = stamp / 1000000000;
  const uint32_t nanoseconds = stamp % 1000000000;
  memcpy(t->raw + t->stamp, &seconds, 4);
  memcpy(t->raw + t->stamp + 4, &nanoseconds, 4);
  for (int i = 0; i < 3; ++i) memcpy(t->raw + t->at[i], t->numbers[i], t->sizes[i]);
  t->raw[t->hold] = hold;
  if (size) put_record(c, t->state, now, state_stamp, state, size);
  put_record(c, t->tick, now, stamp, t->raw, t->size);
}
