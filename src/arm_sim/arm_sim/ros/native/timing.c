/* SPDX-License-Identifier: Apache-2.0 */
#include "timing.h"

#include <math.h>
#include <rcutils/error_handling.h>

#define NEVER (1LL << 62)

int64_t time_of(clockid_t clock) {
  struct timespec now;
  clock_gettime(clock, &now);
  return GIGA * now.tv_sec + now.tv_nsec;
}

/* Set a number that other threads read at any time, for diagnostics; only the ticking thread writes it. */
static void store(int64_t* number, int64_t value) { __atomic_store_n(number, value, __ATOMIC_RELAXED); }

/* --- latencies -------------------------------------------------------------------------------------------------------- */

void histogram_count(histogram_t* h, int64_t duration) {
  int64_t bin = duration > 0 ? duration / 1000 : 0;
  if (bin >= FINE_BINS) {
    bin = (int64_t)(BINS_PER_OCTAVE * log2((double)bin / FINE_BINS));
    bin = FINE_BINS + (bin < COARSE_BINS - 1 ? bin : COARSE_BINS - 1);
  }
  store(h->bins + bin, h->bins[bin] + 1);
  if (duration > h->longest) store(&h->longest, duration);
}

void trip_register_state(trip_t* t, int64_t stamp) {
  t->newest = stamp;
  t->stamps[t->next] = stamp;
  t->times[t->next] = time_of(CLOCK_REALTIME);
  t->next = (t->next + 1) % SENT_STATES;
}

/* Searches from the newest state, which is usually the answered one; of those with the same stamp, it counts: time may
 * have been reset. */
int64_t trip_register_answer(trip_t* t, int64_t stamp, int64_t arrival) {
  const int64_t age = t->acting && t->acting < stamp ? t->newest - t->acting : 0;
  t->acting = 0;
  for (int64_t i = 1; i <= SENT_STATES; ++i) {
    const int64_t k = (t->next + SENT_STATES - i) % SENT_STATES;
    if (t->stamps[k] != stamp) continue;
    t->stamps[k] = -1;
    histogram_count(t->trips, arrival - t->times[k]);
    if (age > t->oldest) store(&t->oldest, age);
    t->acting = stamp;
    break;
  }
  return stamp && stamp == t->newest;
}

/* --- stamps ----------------------------------------------------------------------------------------------------------- */

/* Check once a second whether stamps lag: they then advance faster, or jump. */
static void watch_lag(times_t* t, int64_t now, int64_t lag) {
  if (lag < t->min_lag) t->min_lag = lag;
  if (now < t->next_check) return;
  const int64_t behind = t->tick < t->min_lag && t->min_lag < NEVER ? t->min_lag : 0, jumps = behind > GIGA;
  if (jumps) t->offset += behind;
  t->owed = jumps ? 0 : behind;
  t->min_lag = NEVER;
  t->next_check = now + GIGA;
}

/* The stamp after another one, ahead by a part of what is owed. */
static int64_t next_stamp(times_t* t, int64_t simulated, int64_t now) {
  const int64_t half = (simulated - t->simulated) / 2, more = t->owed < half ? t->owed : half;
  const int64_t stamp = simulated + t->offset + more;
  t->owed -= more;
  return stamp < now ? stamp : now;
}

int64_t times_stamp_at(times_t* t, int64_t simulated, int64_t now, int64_t steady) {
  const int64_t passed = simulated - t->simulated, is_free = t->free || passed < 0;
  t->free = 0;
  if (passed == 0 && !is_free) return t->last;
  const int64_t due = now - (t->even && *t->due ? steady - *t->due : 0);
  int64_t stamp = now;
  if (is_free) t->owed = 0;
  /* After time stood still or began anew, the stamp is the time when the tick is due; of a state before its tick, a tick less. */
  if (t->even && is_free) stamp = due - (passed > 0 ? 0 : t->tick);
  else if (t->even) stamp = next_stamp(t, simulated, now);
  if (t->even && stamp < t->last && t->last < stamp + GIGA) stamp = t->last; /* else the clock was set back */
  t->last = stamp;
  t->simulated = simulated;
  t->offset = stamp - simulated;
  watch_lag(t, now, due - stamp);
  return stamp;
}

int64_t times_stamp_now(times_t* t, int64_t simulated) {
  int64_t now = time_of(CLOCK_REALTIME);
  if (t->foreign && rcl_clock_get_now(t->foreign, &now) != RCL_RET_OK) rcutils_reset_error();
  return times_stamp_at(t, simulated, now, time_of(CLOCK_MONOTONIC));
}

/* --- deadlines -------------------------------------------------------------------------------------------------------- */

int64_t due_next_start(const due_t* d) { return d->deadline > d->earliest ? d->deadline : d->earliest; }

void due_begin_tick(due_t* d, int64_t now) {
  const int64_t late = d->period ? now - d->deadline : 0;
  histogram_count(d->lateness, late);
  if (late > d->period) store(&d->missed, d->missed + 1);
  d->share = late > d->period ? fmin(1.0, (double)(now - d->began) / d->period) : 1.0;
  d->current = d->period ? d->deadline : 0;
  d->began = now;
  d->earliest = now + d->spacing;
  d->deadline += d->period;
  if (late <= d->longest_lag) return;
  /* Shift all deadlines by the lag; or drop as few as leave no more of it than allowed, so that this is rounded up. */
  const int64_t dropped = (d->slow_down ? late : late - d->longest_lag + d->period - 1) / d->period;
  store(&d->dropped, d->dropped + dropped);
  d->deadline += d->slow_down ? late : dropped * d->period;
}

void due_await_tick(due_t* d) {
  const int64_t start = due_next_start(d);
  const struct timespec at = {start / GIGA, start % GIGA};
  int64_t now;
  while ((now = time_of(CLOCK_MONOTONIC)) < start) clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
  due_begin_tick(d, now);
}
