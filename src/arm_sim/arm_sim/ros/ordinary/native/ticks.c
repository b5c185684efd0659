/* SPDX-License-Identifier: Apache-2.0
 *
 * Ordinary ticks: a command of the known controller has arrived or still acts, the arm moves, and the state is
 * published. All other cases are left unchanged to Python, which alone decides on them.
 *
 * Compiled after joint_state.c of arm_dynamics, and record.c. A type with the name of a Python module has the fields of
 * the structure in that module, where they are explained.
 */
#include <sched.h>
#include <time.h>

#define FINE 20000    /* histogram bins of a microsecond, see latency.py */
#define COARSE 512    /* bins beyond, of increasing width */
#define STEPS 32      /* of them per factor of two */
#define SENT 256      /* number of states whose answers are awaited */
#define NEVER (1LL << 62) /* as in stamps.py */
#define ROOMY 4096    /* largest command in bytes that is recorded without a check of the space */

/* Reason for returning: Python must execute the next tick; a tick was executed and Python must publish it; no tick is
 * left to Python, which must decide whether to continue; an answer has arrived, and Python must execute its tick. */
enum { LEFT, MADE, DONE, ANSWERED };

typedef long long (*roll_t)(double*, const double*, long long, const double*, double, long long, double*, double*,
                            double*, void*, void*);

/* roll.Roll: advances the state by a tick. */
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
  int64_t deadline, earliest, period, closest, give_up, slow_down, missed, dropped, ended, current, began;
  double share;
  histogram_t* lateness;
} due_t;

/* stamps.NodeTime */
typedef struct {
  int64_t tick, even, free, simulated, last, offset, least, look, owed;
  const int64_t* due;
} times_t;

/* ticks.Ticks */
typedef struct {
  int64_t* bell; /* nonzero: Python has work between two ticks */
  /* Commands: their source, the admitted controller, and its newest command. */
  source_t* source;
  joint_state_t* reader;
  int64_t at_once;      /* largest number of commands read in a tick */
  int64_t leads[KINDS]; /* kinds of messages whose source commands all joints alone */
  double share; /* part of a tick by which the next one makes commands older */
  /* Of the arbiter: ticks so far, and state of that source. */
  double now;
  int64_t patience;
  double heard;
  int64_t count;
  double age;
  int64_t timeout;
  double* newest;
  int64_t fresh;   /* whether the command is newer than the one known to Python */
  int64_t pending; /* outcome of a message that was taken and that Python must process; NONE: none */
  /* The arm. */
  step_t* step;
  int64_t joints, states;
  int64_t ticks; /* since the last reset */
  int64_t notice; /* whether clipped commands must be reported */
  entry_t* drives; /* (state, command) -> efforts of joint states; NULL: these are the commands */
  /* States for the energy account, which other threads read: the last ones, the number of ticks kept so far, and of
   * those already noted by Python. Without room they are not kept. */
  double *trail, *acted;
  int64_t room, kept, noted;
  /* Outputs. */
  int64_t every, seldom; /* ticks between joint states, and between those after which Python publishes */
  sink_t *state, *clock; /* NULL: no clock */
  times_t* times;        /* NULL: stamps are simulated time */
  trip_t* trip;
  /* The recording; NULL: there is none. */
  chunk_t* chunk;
  tick_t* copy;
  int64_t size, oldest; /* limits of a chunk: bytes, and age in [ns] */
  int64_t commands;     /* number of the channel of commands */
  int64_t recorded;
} ticks_t;

static int64_t time_of(clockid_t clock) {
  struct timespec now;
  clock_gettime(clock, &now);
  return GIGA * now.tv_sec + now.tv_nsec;
}

/* Set a number that other threads read at any time, for diagnostics; only the ticking thread writes it. */
static void show(int64_t* number, int64_t value) { __atomic_store_n(number, value, __ATOMIC_RELAXED); }

/* Histogram.add */
static void count_one(histogram_t* h, int64_t duration) {
  int64_t bin = duration / 1000;
  if (bin >= FINE) {
    bin = (int64_t)(STEPS * log2((double)bin / FINE));
    bin = FINE + (bin < COARSE - 1 ? bin : COARSE - 1);
  }
  if (bin < 0) bin = 0;
  show(h->bins + bin, h->bins[bin] + 1);
  if (duration > h->longest) show(&h->longest, duration);
}

/* RoundTrip.sent */
static void sent(trip_t* t, int64_t stamp) {
  t->newest = stamp;
  t->stamps[t->next] = stamp;
  t->times[t->next] = time_of(CLOCK_REALTIME);
  t->next = (t->next + 1) % SENT;
}

/* RoundTrip.answered; searches from the newest state, which is usually the answered one. */
static void answered(trip_t* t, int64_t stamp, int64_t arrival) {
  for (int64_t i = 1; i <= SENT; ++i) {
    const int64_t k = (t->next + SENT - i) % SENT;
    if (t->stamps[k] != stamp) continue;
    t->stamps[k] = -1;
    count_one(t->trips, arrival - t->times[k]);
    return;
  }
}

/* NodeTime._watch */
static void watch(times_t* t, int64_t now, int64_t lag) {
  if (lag < t->least) t->least = lag;
  if (now < t->look) return;
  const int64_t behind = t->tick < t->least && t->least < NEVER ? t->least : 0, jumps = behind > GIGA;
  if (jumps) t->offset += behind;
  t->owed = jumps ? 0 : behind;
  t->least = NEVER;
  t->look = now + GIGA;
}

/* NodeTime.at of an even clock, from times of the system and of the monotonic clock, in this order; negative: Python
 * must determine it. */
EXPORT int64_t stamp_at(times_t* t, int64_t simulated, int64_t now, int64_t steady) {
  if (!t) return simulated;
  const int64_t passed = simulated - t->simulated;
  if (!t->even || t->free || passed <= 0) return -1;
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
  watch(t, now, now - (*t->due ? steady - *t->due : 0) - stamp);
  return stamp;
}

/* Accept the command that was read last, if Python has admitted its source before; `now`: the tick. */
static int admit(ticks_t* t, int64_t outcome, double now) {
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

/* Inputs.read_waiting; 0: Python must process one. */
static int read_waiting(ticks_t* t) {
  for (int64_t i = 0; i < t->at_once; ++i) {
    const int64_t outcome = take(t->source, t->reader);
    if (outcome == NONE) break;
    if (outcome == FAILED) return 0;
    if (!admit(t, outcome, t->now + t->share)) {
      t->pending = outcome;
      return 0;
    }
    if (t->trip->newest && stamp_of(t->reader) == t->trip->newest) break;
  }
  return 1;
}

static void keep(ticks_t* t) {
  if (!t->room) return;
  const int64_t row = t->kept % t->room;
  memcpy(t->trail + row * t->states, t->step->x, 8 * t->states);
  memcpy(t->acted + row * t->joints, t->step->effort, 8 * t->joints);
  __atomic_store_n(&t->kept, t->kept + 1, __ATOMIC_RELEASE);
}

/* DriveTorques.update */
static void update(ticks_t* t) {
  entry_t* f = t->drives;
  memcpy((double*)f->arguments[0], t->step->x, 8 * t->states);
  memcpy((double*)f->arguments[1], t->step->effort, 8 * t->joints);
  f->function(f->arguments, f->results, f->integers, f->reals, 0);
}

/* Publish and record the state; 0: Python must. */
static int tell(ticks_t* t) {
  const int64_t simulated = llrint(1e9 * (t->ticks * t->step->dt));
  int64_t stamp = -1;
  if (t->ticks % t->every == 0) {
    const int64_t now = time_of(CLOCK_REALTIME), steady = time_of(CLOCK_MONOTONIC);
    if ((stamp = stamp_at(t->times, simulated, now, steady)) < 0) return 0;
    sent(t->trip, stamp);
    if (t->drives) update(t);
    if (send(t->state, stamp) || (t->clock && send(t->clock, stamp))) return 0;
  }
  if (t->chunk) {
    record(t->chunk, t->copy, time_of(CLOCK_REALTIME), simulated, 0, t->state->raw, stamp < 0 ? 0 : t->state->size,
           stamp);
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
  return c->at + most <= t->size && !(c->at && time_of(CLOCK_REALTIME) - c->since > t->oldest);
}

/* Execute a tick with the newest command. */
static int tick(ticks_t* t) {
  step_t* s = t->step;
  if (t->timeout && t->age + t->share > t->timeout) return LEFT;
  memcpy(s->command, t->newest, 8 * t->joints);
  if (s->roll(s->x, s->command, s->stride, s->p, s->dt, 1, s->trace, s->effort, s->notes, s->control, s->report) != 1)
    return LEFT;
  t->age += t->share;
  t->now += t->share;
  ++t->ticks;
  keep(t);
  const int cut = t->notice && memcmp(s->command, s->effort, 8 * t->joints);
  return cut || t->ticks % t->seldom == 0 || !tell(t) ? MADE : DONE;
}

static int64_t wait_until(int64_t wake) {
  const struct timespec at = {wake / GIGA, wake % GIGA};
  int64_t now;
  while ((now = time_of(CLOCK_MONOTONIC)) < wake) clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
  return now;
}

/* RealtimeLoop.share of a tick that begins now. */
static double share_of(const due_t* d, int64_t now, int64_t late) {
  const double passed = late > d->period ? (double)(now - d->began) / d->period : 1.0;
  return passed < 1.0 ? passed : 1.0;
}

/* RealtimeLoop.shift */
static int64_t shift(due_t* d, int64_t late) {
  const int64_t beyond = d->slow_down ? late : late - d->give_up + d->period - 1, dropped = beyond / d->period;
  show(&d->dropped, d->dropped + dropped);
  return d->slow_down ? late : dropped * d->period;
}

/* Execute ticks by the clock, see RealtimeLoop; with a period of 0 one after another. */
EXPORT int64_t by_the_clock(ticks_t* t, due_t* due) {
  for (;;) {
    const int64_t wake = due->deadline > due->earliest ? due->deadline : due->earliest;
    const int64_t now = due->period ? wait_until(wake) : time_of(CLOCK_MONOTONIC);
    const int64_t late = due->period ? now - due->deadline : 0;
    due->current = due->period ? due->deadline : 0;
    t->share = share_of(due, now, late);
    const int made = ready(t) && read_waiting(t) ? tick(t) : LEFT;
    if (made == LEFT) return LEFT;
    due->began = now;
    count_one(due->lateness, late);
    if (late > due->period) show(&due->missed, due->missed + 1);
    due->earliest = now + due->closest;
    due->deadline += due->period;
    if (late > due->give_up) due->deadline += shift(due, late);
    if (made == MADE) return MADE;
    if (__atomic_load_n(&due->ended, __ATOMIC_ACQUIRE)) return DONE;
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

/* Execute the ticks triggered by answers, see Lockstep, as long as these arrive soon. */
EXPORT int64_t in_lockstep(ticks_t* t, waiting_t* w) {
  t->share = 1.0;
  for (;;) {
    const int64_t now = time_of(CLOCK_MONOTONIC);
    if (!ready(t)) return LEFT;
    if (now >= w->end || now - w->asked >= w->soon) return DONE;
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
    while (made == DONE && t->ticks % t->every);
    if (made != DONE) return made == LEFT ? ANSWERED : made;
    wait_for(w, llrint(1e9 * (t->ticks * t->step->dt)));
  }
}
