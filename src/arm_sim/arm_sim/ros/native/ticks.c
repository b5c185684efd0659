/* SPDX-License-Identifier: Apache-2.0 */
#include "ticks.h"

#include <math.h>
#include <sched.h>
#include <string.h>

#define ROOMY 4096 /* largest command in bytes that is recorded here */

/* Ask Python, unless it has raised an exception. */
static int64_t ask(ticks_t* t, int64_t question) { return t->broken ? 0 : t->ask(question); }

/* --- what acts ------------------------------------------------------------------------------------------------------- */

/* What the policy lets act: to hold is to go on with the last command, without one it is no effort. */
static int64_t policy_of(const slot_t* s) { return s->policy != HOLD ? s->policy : s->kind ? s->kind : ZERO; }

int64_t slot_actor(const slot_t* s) { return s->kind ? s->kind : policy_of(s); }

/* Whether a command that ages by a share of a tick is older than it may become. */
static int64_t is_old(const slot_t* s, double share) { return !s->lasting && s->timeout && s->age + share > s->timeout; }

int64_t slot_expires(const slot_t* s, double share) { return s->kind && !s->fresh && !s->stale && is_old(s, share); }

int64_t slot_choose(slot_t* s, double share, int64_t extend) {
  if (!s->kind) return policy_of(s);
  if (s->fresh) s->fresh = s->age = s->stale = 0;
  const int64_t stale = is_old(s, share) && !extend;
  s->age += share;
  s->extended += extend;
  if (!stale) return s->kind;
  s->stale_count += !s->stale;
  s->stale = 1;
  return policy_of(s);
}

/* --- sources of commands ---------------------------------------------------------------------------------------------- */

int64_t stream_is_remembered(const stream_t* s, double now, int64_t patience) { return now - s->last_time <= patience; }

void stream_count(stream_t* s, double now, int64_t patience) {
  s->count = stream_is_remembered(s, now, patience) ? s->count + 1 : 1;
  s->last_time = now;
}

/* --- commands -------------------------------------------------------------------------------------------------------- */

/* Whether there is space in the recording for so many bytes at `log_time`. */
static int has_space(const ticks_t* t, int64_t size) { return t->chunk && chunk_has_room(t->chunk, t->log_time, size); }

/* Whether the command that was read last need not be seen by Python, which has admitted its source. */
static int is_admitted(ticks_t* t, int64_t outcome) {
  if (outcome != KNOWN || !t->trusted_kinds[t->reader->kind]) return 0;
  if (!t->copy) return 1;
  t->log_time = time_of(CLOCK_REALTIME);
  return t->reader->length <= ROOMY && has_space(t, ROOMY + HEADER);
}

/* Accept the command that was read last; returns whether it answers the newest state. */
static int64_t accept(ticks_t* t) {
  slot_t* s = t->slot;
  t->stamp = t->reader->stamp;
  memcpy(s->efforts, t->reader->numbers, 8 * t->joints);
  stream_count(t->arbiter->only, t->arbiter->now, t->arbiter->patience);
  s->kind = EFFORTS;
  s->fresh = s->was_sent = s->unread = 1;
  s->lasting = 0;
  if (t->copy) chunk_put(t->chunk, t->commands, t->log_time, t->log_time, t->reader->raw, t->reader->length);
  return trip_register_answer(t->trip, t->stamp, t->reader->arrival);
}

/* Process a message; returns whether no newer one is expected. */
static int64_t process(ticks_t* t, int64_t outcome) {
  if (is_admitted(t, outcome)) return accept(t);
  t->outcome = outcome;
  t->stamp = -1;
  return ask(t, READ);
}

void ticks_read_commands(ticks_t* t) {
  for (int64_t i = 0; i < t->most_messages && !t->broken; ++i) {
    const int64_t outcome = t->take(t->source, t->reader);
    if (outcome == NONE || process(t, outcome)) break;
  }
}

/* --- the arm --------------------------------------------------------------------------------------------------------- */

/* A tick under what acts; 0: it cannot be computed. */
static int64_t move(ticks_t* t, int64_t actor) {
  const int is_braked = actor == BRAKE && t->locked;
  const int is_free = t->arm && !t->stopping && (actor == EFFORTS || actor == ZERO);
  t->actor = actor;
  if (!is_braked && !is_free) return ask(t, MOVE);
  if (is_free) {
    if (actor == EFFORTS) memcpy(t->arm->command, t->slot->efforts, 8 * t->joints);
    else memset(t->arm->command, 0, 8 * t->joints);
    if (!t->arm->tick(t->arm)) return 0;
  }
  ++t->step_count;
  t->hold = is_braked ? BRAKES : FREE;
  if (t->has_sensors || (t->needs_cut_notice && is_free && memcmp(t->arm->command, t->effort, 8 * t->joints))) ask(t, SENSE);
  return 1;
}

/* Keep the state after the last tick for the energy account. */
static void keep(ticks_t* t) {
  if (!t->rows) return;
  const int64_t row = t->kept_count % t->rows;
  memcpy(t->state_trail + row * t->states, t->x, 8 * t->states);
  memcpy(t->effort_trail + row * t->joints, t->effort, 8 * t->joints);
  t->ticks[row] = t->hold == BRAKES ? -t->step_count : t->step_count;
  __atomic_store_n(&t->kept_count, t->kept_count + 1, __ATOMIC_RELEASE);
}

/* Whether Python must note states before another one is kept. */
static int is_full(ticks_t* t) {
  return t->rows && t->kept_count - __atomic_load_n(&t->noted_count, __ATOMIC_ACQUIRE) >= t->rows;
}

/* --- outputs --------------------------------------------------------------------------------------------------------- */

static int64_t simulated_time(const ticks_t* t) { return llrint(1e9 * (t->step_count * t->dt)); }

void ticks_publish_state(ticks_t* t) {
  const int64_t simulated = simulated_time(t),
                stamp = t->state_stamp = t->times ? times_stamp_now(t->times, simulated) : simulated;
  t->idle_time = 0.0;
  trip_register_state(t->trip, stamp);
  if (t->drives) t->drives->function(t->drives->arguments, t->drives->results, t->drives->integers, t->drives->reals, 0);
  if (t->needs_filling) ask(t, FILL);
  if (joint_state_send(t->joint_states, stamp) || (t->ground_truth && joint_state_send(t->ground_truth, stamp))
      || (t->clock && joint_state_send(t->clock, stamp)))
    ask(t, UNSENT);
}

/* Record the last tick, and the joint state published for it. */
static void record_tick(ticks_t* t, int publishes) {
  const int64_t size = publishes ? t->joint_states->size : 0;
  t->needed_space = size + t->copy->size + 2 * HEADER;
  for (t->log_time = time_of(CLOCK_REALTIME); !has_space(t, t->needed_space); t->log_time = time_of(CLOCK_REALTIME))
    if (!ask(t, SPACE)) return;
  chunk_record(t->chunk, t->copy, t->log_time, simulated_time(t), t->hold, size ? t->joint_states->raw : NULL, size,
               t->state_stamp);
  ++t->recorded_count;
}

/* Publish and record the last tick. */
static void write_tick(ticks_t* t) {
  const int publishes = t->joint_states && t->step_count % t->state_period == 0;
  if (publishes) ticks_publish_state(t);
  if (t->copy) record_tick(t, publishes);
  if (t->has_listeners || t->step_count % t->slow_period == 0 || t->slot->stale != t->was_stale || is_full(t)) ask(t, TICKED);
}

/* --- ticks ----------------------------------------------------------------------------------------------------------- */

/* A tick under the newest command; returns whether it was made. `ages`: it makes the command older. */
static int update(ticks_t* t, int64_t ages) {
  slot_t* s = t->slot;
  if (t->needs_preparation) ask(t, PREPARE);
  const int64_t extend = ages && slot_expires(s, t->share) && ask(t, EXPIRE);
  if (t->broken || !move(t, ages ? slot_choose(s, t->share, extend) : slot_actor(s))) {
    t->broken = 1;
    return 0;
  }
  keep(t);
  write_tick(t);
  return 1;
}

void ticks_tick(ticks_t* t) {
  if (__atomic_load_n(t->bell, __ATOMIC_ACQUIRE)) ask(t, SERVE);
  t->arbiter->now += t->share;
  if (!t->paused) ticks_read_commands(t);
  if (!t->paused && (t->slot->was_sent || !t->waits_for_command)) update(t, 1);
  else ask(t, IDLE);
}

void ticks_by_the_clock(ticks_t* t, due_t* due) {
  while (!t->broken && !__atomic_load_n(&due->ended, __ATOMIC_ACQUIRE)) {
    due_await_tick(due);
    t->share = due->share;
    ticks_tick(t);
  }
}

/* Process the next message that arrives soon; 0: none does, or others have their turn. */
static int next_answer(ticks_t* t, const waiting_t* w) {
  int64_t now;
  while ((now = time_of(CLOCK_MONOTONIC)) - w->published < w->soon && now < w->end && !t->broken) {
    const int64_t outcome = t->take(t->source, t->reader);
    if (outcome != NONE) {
      process(t, outcome);
      return !t->broken;
    }
    sched_yield();
  }
  return 0;
}

/* The ticks that follow the answer to the awaited state; then the next state is awaited. */
static void go_on(ticks_t* t, waiting_t* w) {
  do ticks_tick(t);
  while (!t->paused && !t->broken && t->step_count % t->state_period);
  w->stamp = t->paused ? -1 : simulated_time(t);
  w->published = w->first = time_of(CLOCK_MONOTONIC);
}

void ticks_in_lockstep(ticks_t* t, waiting_t* w, int64_t stamp) {
  t->share = 1.0;
  t->stamp = stamp;
  do {
    if (t->stamp >= 0 && t->stamp == w->stamp) go_on(t, w);
    else w->ignored += t->stamp >= 0;
  } while (w->stamp >= 0 && next_answer(t, w));
}

int64_t ticks_advance(ticks_t* t, int64_t count) {
  int64_t completed = 0;
  while (completed < count && update(t, 0)) ++completed;
  return completed;
}
