/* SPDX-License-Identifier: Apache-2.0
 *
 * Buffers of a recording. Python reads this header (chunk.py, ticks.py), checks that there is room, and reads the
 * records, which are those of MCAP (https://mcap.dev/spec).
 */
#pragma once
#include <stdint.h>

#include "entry.h"

enum { HEADER = 31 }; /* bytes of a record before its data */

/* A buffer for records in the format of the file. */
typedef struct {
  uint8_t* raw;
  int64_t* places;   /* offset of each record */
  int64_t at, count; /* number of bytes and records so far */
  int64_t since;     /* time of the first record in [ns] */
  int64_t size, oldest; /* limits: bytes, and age in [ns] */
} chunk_t;

/* Whether records of this many bytes, which arrive now, fit; not in a chunk that is too old. */
QUICK int64_t chunk_has_room(const chunk_t* c, int64_t now, int64_t size);

/* The data copied with every tick. */
typedef struct {
  uint8_t* raw; /* a serialized arm_msgs/Tick, and the offsets of its variable parts */
  int64_t size, stamp_at, hold_at, at[3];
  const uint8_t* numbers[3]; /* state, effective command, and notes */
  int64_t sizes[3];          /* in bytes */
  int64_t tick_channel, state_channel;
} tick_t;

/* Copy a message of a channel; `log` and `publish` are times in [ns]. */
QUICK void chunk_put(chunk_t* c, int64_t channel, int64_t log, int64_t publish, const uint8_t* data, int64_t size);

/* Copy the tick of this stamp in [ns], executed at `now`; before it the published joint state, if `size` is not 0. */
QUICK void chunk_record(chunk_t* c, tick_t* t, int64_t now, int64_t stamp, int64_t hold, const uint8_t* state, int64_t size,
                        int64_t state_stamp);
