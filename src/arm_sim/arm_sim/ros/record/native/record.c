/* SPDX-License-Identifier: Apache-2.0
 *
 * Copies a tick, and the joint state published for it, into a message buffer in a single call.
 */
#include "record.h"

#include <string.h>

/* What MCAP has before the data of a message; likewise MESSAGE of chunk.py. */
typedef struct __attribute__((packed)) {
  uint8_t opcode;
  uint64_t length; /* of what follows: without these 9 bytes */
  uint16_t channel;
  uint32_t sequence;
  int64_t log, publish;
} head_t;

_Static_assert(sizeof(head_t) == HEADER, "MCAP has no gaps");

int64_t chunk_has_room(const chunk_t* c, int64_t now, int64_t size) {
  return c->at + size <= c->size && !(c->at && now - c->since > c->oldest);
}

void chunk_put(chunk_t* c, int64_t channel, int64_t log, int64_t publish, const uint8_t* data, int64_t size) {
  uint8_t* to = c->raw + c->at;
  const head_t head = {.opcode = 5, .length = HEADER - 9 + size, .channel = channel, .log = log, .publish = publish};
  memcpy(to, &head, HEADER);
  memcpy(to + HEADER, data, size);
  if (!c->at) c->since = log;
  c->places[c->count++] = c->at;
  c->at += HEADER + size;
}

void chunk_record(chunk_t* c, tick_t* t, int64_t now, int64_t stamp, int64_t hold, const uint8_t* state, int64_t size,
                  int64_t state_stamp) {
  const uint32_t time[2] = {stamp / 1000000000, stamp % 1000000000};
  memcpy(t->raw + t->stamp_at, time, sizeof time);
  for (int i = 0; i < 3; ++i) memcpy(t->raw + t->at[i], t->numbers[i], t->sizes[i]);
  t->raw[t->hold_at] = hold;
  if (size) chunk_put(c, t->state_channel, now, state_stamp, state, size);
  chunk_put(c, t->tick_channel, now, stamp, t->raw, t->size);
}
