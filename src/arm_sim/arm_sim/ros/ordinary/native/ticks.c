/* SPDX-License-Identifier: Apache-2.0
 *
 * Ordinary ticks: a command of the known controller has arrived or still acts, the arm moves, and the state is
 * published. All other cases are left unchanged to Python, which alone decides on them. The rules that both follow are
 * in loop.c.
 */
#include "ticks.h"

#include <math.h>
#include <sched.h>
#include <string.h>

#define ROOMY 4096 /* largest command in bytes that is recorded without a check of the space */

/* Whether Python has admitted the source of the command that was read last. */
static int is_admitted(const ticks_t* t, int64_t outcome) {
  int64_t kind;
  memcpy(&kind, t->reader->found + 16, 8);
  return outcome == KNOWN && t->leads[kind] && t->reader->length <= ROOMY;
}

/* Accept the command that was read last; returns whether it answers the newest state. `now`: the tick. */
static int64_t accept(ticks_t* t, double now) {
  int64_t told[3]; /* stamp, arrival, kind */
  memcpy(told, t->reader->found, sizeof told);
  memcpy(t->newest, t->reader->found + sizeof told, 8 * t->joints);
  hear(t->stream, now, t->patience);
  t->fresh = 1;
  t->age = 0;
  if (t->chunk) {
    const int64_t log = time_of(CLOCK_REALTIME);
    put_record(t->chunk, t->commands, log, log, t->reader->raw, t->reader->length);
  }
  return answered(t->trip, told[0], told[1]);
}

/* Read the commands since the last tick, as Inputs.read_waiting; 0: Python must process one. */
static int read_waiting(ticks_t* t) {
  for (int64_t i = 0; i < t->at_once; ++i) {
    const int64_t outcome = take(t->source, t->reader);
    if (outcome == NONE) break;
    if (outcome == FAILED) return 0;
    if (!is_admitted(t, outcome)) {
      t->pending = outcome;
      return 0;
    }
    if (accept(t, t->now + t->share)) break;
  }
  return 1;
}

static void keep(ticks_t* t) {
  if (!t->room) return;
  const int64_t row = t->kept % t->room;
  memcpy(t->trail + row * t->states, t->step->x, 8 * t->states);
  memcpy(t->acted + row * t->joints, t->step->acted, 8 * t->joints);
  __atomic_store_n(&t->kept, t->kept + 1, __ATOMIC_RELEASE);
}

/* Evaluate the torques of drives. */
static void update(ticks_t* t) {
  entry_t* f = t->drives;
  memcpy((double*)f->arguments[0], t->step->x, 8 * t->states);
  memcpy((double*)f->arguments[1], t->step->acted, 8 * t->joints);
  f->function(f->arguments, f->results, f->integers, f->reals, 0);
}

/* Publish and record the state; 0: Python must, which knows the clock of another node. */
static int tell(ticks_t* t) {
  const int64_t simulated = llrint(1e9 * (t->ticks * t->step->dt));
  int64_t stamp = -1;
  if (t->ticks % t->every == 0) {
    if (t->times && !t->times->even) return 0;
    const int64_t now = time_of(CLOCK_REALTIME), steady = time_of(CLOCK_MONOTONIC);
    stamp = t->times ? stamp_at(t->times, simulated, now, steady) : simulated;
    sent(t->trip, stamp);
    if (t->drives) update(t);
    if (send(t->state, stamp) || (t->clock && send(t->clock, stamp))) return 0;
  }
  if (t->chunk) {
    record(t->chunk, t->copy, time_of(CLOCK_REALTIME), simulated, 0, t->state->raw, stamp < 0 ? 0 : t->state->size, stamp);
    ++t->recorded;
  }
  return 1;
}

/* Whether Python has no work, and there is room for all messages of a tick. */
static int ready(const ticks_t* t) {
  const chunk_t* c = t->chunk;
  if (__atomic_load_n(t->bell, __ATOMIC_ACQUIRE)) return 0;
  if (t->room && t->kept - __atomic_load_n(&t->noted, __ATOMIC_ACQUIRE) >= t->room) return 0;
  if (!c) return 1;
  const int64_t most = (t->at_once + 1) * (ROOMY + 31) + t->state->size + t->copy->size + 62;
  return has_room(c, time_of(CLOCK_REALTIME), most);
}

/* Execute a tick with the newest command. */
static int tick(ticks_t* t) {
  arm_t* arm = t->step;
  if (is_stale(t->age, t->share, t->timeout)) return LEFT;
  memcpy(arm->command, t->newest, 8 * t->joints);
  if (!arm->tick(arm)) return LEFT;
  t->age += t->share;
  t->now += t->share;
  ++t->ticks;
  keep(t);
  const int cut = t->notice && memcmp(arm->command, arm->acted, 8 * t->joints);
  return cut || t->ticks % t->seldom == 0 || !tell(t) ? MADE : DONE;
}

int64_t by_the_clock(ticks_t* t, due_t* due) {
  for (;;) {
    await_tick(due);
    t->share = due->share;
    const int made = ready(t) && read_waiting(t) ? tick(t) : LEFT;
    if (made != DONE) return made;
    if (__atomic_load_n(&due->ended, __ATOMIC_ACQUIRE)) return DONE;
  }
}

int64_t in_lockstep(ticks_t* t, waiting_t* w) {
  int64_t stamp;
  t->share = 1.0;
  for (;;) {
    if (!ready(t)) return LEFT;
    if (!is_expected(w) || time_of(CLOCK_MONOTONIC) >= w->end) return DONE;
    const int64_t outcome = take(t->source, t->reader);
    if (outcome == FAILED) return LEFT;
    if (outcome == NONE) {
      sched_yield();
      continue;
    }
    if (!is_admitted(t, outcome)) {
      t->pending = outcome;
      return LEFT;
    }
    accept(t, t->now);
    memcpy(&stamp, t->reader->found, 8);
    if (!is_answer(w, stamp)) continue;
    int made;
    do made = ready(t) ? tick(t) : LEFT;
    while (made == DONE && t->ticks % t->every);
    if (made != DONE) return made == LEFT ? ANSWERED : made;
    await_answer(w, llrint(1e9 * (t->ticks * t->step->dt)));
  }
}
