/* SPDX-License-Identifier: Apache-2.0
 *
 * Ordinary ticks: a command like those before has come or still acts, the arm moves, and the state is told. Whatever is
 * out of the ordinary is left to Python, untouched, which alone decides on it.
 *
 * Before this file: joint_state.c of arm_dynamics, and record.c. Where a type is said to be of Python, the fields are
 * those of the structure of that module, which also says what they mean.
 */
#include <sched.h>
#include <time.h>

#define FINE 20000    /* bins of a microsecond in a histogram, see latency.py */
#define COARSE 512    /* and beyond, each longer than the one before */
#define STEPS 32      /* of a factor of two */
#define SENT 256      /* states whose answers are awaited */
#define ROOMY 4096    /* bytes of a command that may be in a recording without a closer look */
#define TURN 100000000 /* [ns] after which Python is asked whether to go on */

/* Why ticks end: the next one is to be made by Python; one was made, and Python has to tell of it; it is time to ask;
 * there is an answer, and Python has to make the tick that follows it. */
enum { LEFT, MADE, TURN_OVER, ANSWERED };

typedef long long (*roll_t)(double*, const double*, long long, const double*, double, long long, double*, double*,
                            double*, void*, void*);

/* roll.Roll: what advances the state by a tick. */
typedef struct {
  roll_t roll;
  double* x;
  double* command;
  int64_t stride;
  const double* p;
  double dt;
  int64_t ticks;
  double *trace, *effort, *notes;
  void *control, *report;
} step_t;

/* latency.Histogram */
typedef struct {
  int64_t* bins;
  int64_t longest;
} histogram_t;

/* latency.RoundTrip */
typedef struct {
  int64_t newest, next;
  int64_t *stamps, *times;
  histogram_t* trips;
} trip_t;

/* realtime_loop.Due */
typedef struct {
  int64_t deadline, earliest, period, closest, give_up, slow_down, missed, dropped;
  histogram_t* lateness;
} due_t;

/* stamps.NodeTime */
typedef struct {
  int64_t tick, even, free, simulated, last, offset, least, look, owed;
} times_t;

/* ticks.Ticks */
typedef struct {
  int64_t* bell; /* not 0: Python has something to do between two ticks */
  /* Commands: where they come from, who may lead, and what it said last. */
  source_t* source;
  joint_state_t* reader;
  int64_t at_once;      /* commands read in a tick at most */
  int64_t leads[KINDS]; /* kinds of messages whose source leads all joints alone */
  int64_t now, patience, heard, count; /* of the arbiter: ticks so far, and of that source */
  int64_t age, timeout;
  double* newest;
  int64_t fresh;   /* whether it is newer than what Python knows */
  int64_t pending; /* outcome of a message that was taken and is left to Python; NONE: there is none */
  /* The arm. */
  step_t* step;
  int64_t joints, states;
  int64_t ticks; /* since the last reset */
  int64_t notice; /* whether commands that were cut are told */
  /* States before Python looked at them, for the energy account; no room: they are not kept. */
  double *trail, *acted;
  int64_t rows, room;
  /* What is told. */
  int64_t every, seldom; /* ticks from joint state to joint state, and to what Python publishes */
  sink_t *state, *clock; /* NULL: no clock */
  times_t* times;        /* NULL: stamps are simulated time */
  trip_t* trip;
  /* The recording; NULL: there is none. */
  chunk_t* chunk;
  tick_t* copy;
  int64_t size, oldest; /* bytes that may be in a chunk, and their age in [ns] */
  int64_t commands;     /* number of the commands' channel */
  int64_t recorded;
} ticks_t;

static int64_t time_of(clockid_t clock) {
  struct timespec now;
  clock_gettime(clock, &now);
  return GIGA * now.tv_sec + now.tv_nsec;
}

/* Histogram.add */
static void count_one(histogram_t* h, int64_t duration) {
  int64_t bin = duration / 1000;
  if (bin >= FINE) {
    bin = (int64_t)(STEPS * log2((double)bin / FINE));
    bin = FINE + (bin < COARSE - 1 ? bin : COARSE - 1);
  }
  ++h->bins[bin > 0 ? bin : 0];
  if (duration > h->longest) h->longest = duration;
}

/* RoundTrip.sent */
static void sent(trip_t* t, int64_t stamp) {
  t->newest = stamp;
  t->stamps[t->next] = stamp;
  t->times[t->next] = time_of(CLOCK_REALTIME);
  t->next = (t->next + 1) % SENT;
}

/* RoundTrip.answered; the newest state first: it is the one that is answered. */
static void answered(trip_t* t, int64_t stamp, int64_t arrival) {
  for (int64_t i = 1; i <= SENT; ++i) {
    const int64_t k = (t->next + SENT - i) % SENT;
    if (t->stamps[k] != stamp) continue;
    t->stamps[k] = -1;
    count_one(t->trips, arrival - t->times[k]);
    return;
  }
}

/* NodeTime.at of an even clock, between two looks at the lag; negative: Python has to say. */
EXPORT int64_t stamp_at(times_t* t, int64_t simulated, int64_t now) {
  if (!t) return simulated;
  const int64_t passed = simulated - t->simulated;
  if (!t->even || t->free || passed <= 0 || now >= t->look) return -1;
  const int64_t more = t->owed < passed / 2 ? t->owed : passed / 2;
  int64_t stamp = simulated + t->offset + more;
  if (stamp > now) stamp = now;
  if (stamp < t->last) {
    if (t->last - stamp >= GIGA) return -1; /* the clock was set back */
    stamp = t->last;
  }
  t->owed -= more;
  t->last = stamp;
  t->simulated = simulated;
  t->offset = stamp - simulated;
  if (now - stamp < t->least) t->least = now - stamp;
  return stamp;
}

/* Take in the command that was read last, if it is one of those that Python has admitted before; `now`: the tick. */
static int admit(ticks_t* t, int64_t outcome, int64_t now) {
  int64_t told[3];
  memcpy(told, t->reader->found, sizeof told);
  if (outcome != KNOWN || !t->leads[told[2]] || t->reader->length > ROOMY) return 0;
  memcpy(t->newest, t->reader->found + sizeof told, 8 * t->joints);
  t->count = now - t->heard <= t->patience ? t->count + 1 : 1;
  t->heard = now;
  t->fresh = 1;
  t->age = 0;
  if (t->chunk) {
    const int64_t log = time_of(CLOCK_REALTIME);
    put_record(t->chunk, t->commands, log, log, t->reader->raw, t->reader->length);
  }
  answered(t->trip, told[0], told[1]);
  return 1;
}

static int64_t stamp_of(const joint_state_t* s) {
  int64_t stamp;
  memcpy(&stamp, s->found, 8);
  return stamp;
}

/* Inputs.read_waiting; 0: Python has to look at one. */
static int read_waiting(ticks_t* t) {
  for (int64_t i = 0; i < t->at_once; ++i) {
    const int64_t outcome = take(t->source, t->reader);
    if (outcome == NONE) break;
    if (outcome == FAILED) return 0;
    if (!admit(t, outcome, t->now + 1)) {
      t->pending = outcome;
      return 0;
    }
    if (t->trip->newest && stamp_of(t->reader) == t->trip->newest) break;
  }
  return 1;
}

static void keep(ticks_t* t) {
  if (!t->room) return;
  memcpy(t->trail + t->rows * t->states, t->step->x, 8 * t->states);
  memcpy(t->acted + t->rows * t->joints, t->step->effort, 8 * t->joints);
  ++t->rows;
}

/* Publish and record the state; 0: Python has to. */
static int tell(ticks_t* t) {
  const int64_t simulated = llrint(1e9 * (t->ticks * t->step->dt));
  int64_t stamp = -1;
  if (t->ticks % t->every == 0) {
    if ((stamp = stamp_at(t->times, simulated, time_of(CLOCK_REALTIME))) < 0) return 0;
    sent(t->trip, stamp);
    if (send(t->state, stamp) || (t->clock && send(t->clock, stamp))) return 0;
  }
  if (t->chunk) {
    record(t->chunk, t->copy, time_of(CLOCK_REALTIME), simulated, 0, t->state->raw, stamp < 0 ? 0 : t->state->size,
           stamp);
    ++t->recorded;
  }
  return 1;
}

/* Whether Python has nothing to do, and there is room for all that a tick may bring. */
static int ready(const ticks_t* t) {
  const chunk_t* c = t->chunk;
  if (__atomic_load_n(t->bell, __ATOMIC_ACQUIRE) || (t->room && t->rows == t->room)) return 0;
  if (!c) return 1;
  const int64_t most = (t->at_once + 1) * (ROOMY + 31) + t->state->size + t->copy->size + 62;
  return c->at + most <= t->size && !(c->at && time_of(CLOCK_REALTIME) - c->since > t->oldest);
}

/* Make a tick under the newest command. */
static int tick(ticks_t* t) {
  step_t* s = t->step;
  if (t->timeout && t->age >= t->timeout) return LEFT;
  memcpy(s->command, t->newest, 8 * t->joints);
  if (s->roll(s->x, s->command, s->stride, s->p, s->dt, 1, s->trace, s->effort, s->notes, s->control, s->report) != 1)
    return LEFT;
  ++t->age;
  ++t->now;
  ++t->ticks;
  keep(t);
  const int cut = t->notice && memcmp(s->command, s->effort, 8 * t->joints);
  return cut || t->ticks % t->seldom == 0 || !tell(t) ? MADE : TURN_OVER;
}

static int64_t wait_until(int64_t wake) {
  const struct timespec at = {wake / GIGA, wake % GIGA};
  int64_t now;
  while ((now = time_of(CLOCK_MONOTONIC)) < wake) clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
  return now;
}

/* RealtimeLoop.shift */
static int64_t shift(due_t* d, int64_t late) {
  const int64_t beyond = d->slow_down ? late : late - d->give_up + d->period - 1, dropped = beyond / d->period;
  d->dropped += dropped;
  return d->slow_down ? late : dropped * d->period;
}

/* Make ticks by the clock, see RealtimeLoop; with a period of 0 one after another. */
EXPORT int64_t by_the_clock(ticks_t* t, due_t* due) {
  const int64_t end = time_of(CLOCK_MONOTONIC) + TURN;
  for (;;) {
    const int64_t wake = due->deadline > due->earliest ? due->deadline : due->earliest;
    const int64_t now = due->period ? wait_until(wake) : time_of(CLOCK_MONOTONIC);
    const int64_t late = due->period ? now - due->deadline : 0;
    const int made = ready(t) && read_waiting(t) ? tick(t) : LEFT;
    if (made == LEFT) return LEFT;
    count_one(due->lateness, late);
    due->missed += late > due->period;
    due->earliest = now + due->closest;
    due->deadline += due->period;
    if (late > due->give_up) due->deadline += shift(due, late);
    if (made == MADE) return MADE;
    if (now > end) return TURN_OVER;
  }
}

/* lockstep.Waiting */
typedef struct {
  int64_t stamp, asked, first, ignored, soon, end;
} waiting_t;

/* Lockstep.wait */
static void wait_for(waiting_t* w, int64_t stamp) {
  w->stamp = stamp;
  w->asked = w->first = time_of(CLOCK_MONOTONIC);
}

/* Make the ticks that answers ask for, see Lockstep, as long as these come soon. */
EXPORT int64_t in_lockstep(ticks_t* t, waiting_t* w) {
  for (;;) {
    const int64_t now = time_of(CLOCK_MONOTONIC);
    if (!ready(t)) return LEFT;
    if (now >= w->end || now - w->asked >= w->soon) return TURN_OVER;
    const int64_t outcome = take(t->source, t->reader);
    if (outcome == FAILED) return LEFT;
    if (outcome == NONE) {
      sched_yield();
      continue;
    }
    if (!admit(t, outcome, t->now)) {
      t->pending = outcome;
      return LEFT;
    }
    if (stamp_of(t->reader) != w->stamp) {
      ++w->ignored;
      continue;
    }
    int made;
    do made = ready(t) ? tick(t) : LEFT;
    while (made == TURN_OVER && t->ticks % t->every);
    if (made != TURN_OVER) return made == LEFT ? ANSWERED : made;
    wait_for(w, llrint(1e9 * (t->ticks * t->step->dt)));
  }
}
