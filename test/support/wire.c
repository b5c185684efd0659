/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages that arrive when a test says so, in place of the middleware. Compiled after joint_state.c.
 */
#define WIRES 8

/* Messages for a subscription, each of which ends at `ends[k]`; after an empty one the next arrive after the next tick. */
typedef struct {
  const rcl_subscription_t* to;
  const uint8_t* raw;
  const int64_t* ends;
  int64_t count, taken;
  int64_t* bell;        /* rung when all are taken */
  const uint8_t* state; /* the message that every tick publishes, by whose stamp ticks are told apart */
  uint8_t stamp[8];     /* of the last one seen */
} wire_t;

static wire_t wires[WIRES];

static wire_t* wire_of(const rcl_subscription_t* to) {
  wire_t* w = wires;
  while (w->to && w->to != to) ++w;
  return w;
}

/* Size of the next message. */
static int64_t next_size(const wire_t* w) { return w->ends[w->taken] - (w->taken ? w->ends[w->taken - 1] : 0); }

/* Replace what is on its way to a subscription; `raw` and `ends` stay valid until the next call. */
EXPORT void put_on_wire(const wire_t* wire) {
  wire_t* w = wire_of(wire->to);
  *w = *wire;
  memcpy(w->stamp, w->state + STAMP, 8);
}

/* How many have not been taken. */
EXPORT int64_t left_on_wire(const rcl_subscription_t* to) {
  const wire_t* w = wire_of(to);
  return w->count - w->taken;
}

rcl_ret_t rcl_take_serialized_message(const rcl_subscription_t* s, rcl_serialized_message_t* m, rmw_message_info_t* about,
                                      rmw_subscription_allocation_t* a) {
  (void)a;
  wire_t* w = wire_of(s);
  const int ticked = w->state && memcmp(w->stamp, w->state + STAMP, 8);
  if (ticked) memcpy(w->stamp, w->state + STAMP, 8);
  if (ticked && w->taken < w->count && !next_size(w)) ++w->taken;
  if (w->taken == w->count && w->bell) *w->bell = 1;
  if (w->taken == w->count || !next_size(w)) return RCL_RET_SUBSCRIPTION_TAKE_FAILED;
  const int64_t size = next_size(w);
  /* Memory of exactly this size, so that a sanitizer notices who reads beyond it. */
  m->allocator.deallocate(m->buffer, m->allocator.state);
  m->buffer = m->allocator.allocate(size, m->allocator.state);
  memcpy(m->buffer, w->raw + w->ends[w->taken++] - size, size);
  m->buffer_length = m->buffer_capacity = size;
  about->received_timestamp = 0;
  return RCL_RET_OK;
}
