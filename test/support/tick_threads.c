/* SPDX-License-Identifier: Apache-2.0
 *
 * The threads of a sim node, all in C, so that a sanitizer sees every access of each. What Python does in the node is
 * done here in the same order and under the same locks; in place of the middleware, a controller answers the last
 * state. Compiled after the code of the node.
 *
 *   ticking   RealtimeLoop, and the answers to its questions         ordering   a service: TickQueue.run
 *   writing   ChunkThread                                            looking    SimDiagnostics, EnergyTopic
 */
#include <pthread.h>

#define JOINTS 2
#define HEAD 16 /* of a message, before its numbers */
#define MESSAGE (HEAD + 8 * JOINTS)
#define CHUNK 65536
#define NEWS 8 /* [ticks] after which a command is too old */
#define ROWS 16 /* ticks kept for the energy account */

typedef pthread_mutex_t lock_t;

typedef struct {
  int64_t orders, ticks, recorded, written, counted, looks, noted; /* what was done; found by the test */
} done_t;

/* The queue of orders, and the lock of the recording. */
static lock_t queue = PTHREAD_MUTEX_INITIALIZER, recording = PTHREAD_MUTEX_INITIALIZER;
static lock_t noting = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t served = PTHREAD_COND_INITIALIZER, filled = PTHREAD_COND_INITIALIZER;
static int64_t ordered, fulfilled, full;

static int64_t bell, ended, lateness_bins[FINE_BINS + COARSE_BINS], trip_bins[FINE_BINS + COARSE_BINS];
static int64_t stamps[SENT_STATES], times[SENT_STATES];
static double x[JOINTS], acted[JOINTS], newest[JOINTS], next_command[JOINTS], read[JOINTS];
static double kept_states[ROWS * JOINTS], kept_efforts[ROWS * JOINTS];
static int64_t kept_ticks[ROWS];
static uint8_t state_raw[MESSAGE], tick_raw[MESSAGE], chunk_raw[2][CHUNK];
static int64_t places[2][CHUNK / 31];
static chunk_t chunks[2];
static done_t done;

static uint8_t command_raw[MESSAGE];
static int command_waits; /* the one for the last state */

rcl_ret_t rcl_take_serialized_message(const rcl_subscription_t* s, rcl_serialized_message_t* m, rmw_message_info_t* about,
                                      rmw_subscription_allocation_t* a) {
  (void)s, (void)a;
  if (!command_waits) return RCL_RET_SUBSCRIPTION_TAKE_FAILED;
  command_waits = 0;
  m->buffer = command_raw;
  m->buffer_length = MESSAGE;
  about->received_timestamp = time_of(CLOCK_REALTIME);
  return RCL_RET_OK;
}

rcl_ret_t rcl_publish_serialized_message(const rcl_publisher_t* p, const rcl_serialized_message_t* m,
                                         rmw_publisher_allocation_t* a) {
  (void)p, (void)a;
  const double efforts[JOINTS] = {1.0, 2.0};
  memcpy(command_raw + STAMP, m->buffer + STAMP, 8);
  memcpy(command_raw + HEAD, efforts, sizeof efforts);
  command_waits = 1;
  return RCL_RET_OK;
}

/* One tick of an arm that moves by its command. */
static int drive(arm_t* arm) {
  for (int i = 0; i < JOINTS; ++i) {
    arm->x[i] += arm->command[i];
    arm->acted[i] = arm->command[i];
  }
  return 1;
}

static int64_t is_over(void) { return __atomic_load_n(&ended, __ATOMIC_RELAXED); }

/* Gives an order and waits until it is fulfilled, `count` times; as ctypes does, it writes the bell at once. */
static void* ordering(void* count) {
  for (int64_t i = 0; i < *(int64_t*)count; ++i) {
    pthread_mutex_lock(&queue);
    ++ordered;
    pthread_mutex_unlock(&queue);
    __atomic_store_n(&bell, 1, __ATOMIC_RELAXED);
    pthread_mutex_lock(&queue);
    while (fulfilled <= i) pthread_cond_wait(&served, &queue);
    pthread_mutex_unlock(&queue);
  }
  __atomic_store_n(&ended, 1, __ATOMIC_RELAXED);
  return NULL;
}

/* Number of durations in a histogram; NumPy reads each number at once. */
static int64_t count_of(const histogram_t* h) {
  int64_t sum = 0;
  for (int i = 0; i < FINE_BINS + COARSE_BINS; ++i) sum += __atomic_load_n(h->bins + i, __ATOMIC_RELAXED);
  return sum + 0 * __atomic_load_n(&h->longest, __ATOMIC_RELAXED);
}

/* EnergyAccount.note; counts ticks whose efforts belong together. */
static void note(ticks_t* t) {
  pthread_mutex_lock(&noting);
  const int64_t kept = __atomic_load_n(&t->kept_count, __ATOMIC_ACQUIRE);
  for (int64_t k = t->noted_count; k < kept; ++k) {
    const double* effort = kept_efforts + k % ROWS * JOINTS;
    done.noted += effort[1] == 2.0 * effort[0];
  }
  __atomic_store_n(&t->noted_count, kept, __ATOMIC_RELEASE);
  pthread_mutex_unlock(&noting);
}

typedef struct {
  ticks_t* ticks;
  due_t* due;
} loop_t;

static void* looking(void* of) {
  const struct timespec moment = {0, 1000000};
  const loop_t* loop = of;
  while (!is_over()) {
    const int64_t before = count_of(loop->due->lateness);
    const int64_t late = __atomic_load_n(&loop->due->missed, __ATOMIC_RELAXED);
    const int64_t gone = __atomic_load_n(&loop->due->dropped, __ATOMIC_RELAXED);
    done.looks += before >= 0 && late >= 0 && gone >= 0 && count_of(loop->ticks->trip->trips) >= 0;
    note(loop->ticks);
    nanosleep(&moment, NULL);
  }
  return NULL;
}

/* Takes full chunks; the other one is being filled. */
static void* writing(void* nothing) {
  pthread_mutex_lock(&recording);
  for (;;) {
    while (full < 0 && !is_over()) pthread_cond_wait(&filled, &recording);
    if (full < 0) break;
    chunk_t* c = chunks + full;
    for (int64_t k = 0; k < c->count; ++k) done.written += c->raw[c->places[k] + 9] == 1; /* channel of ticks */
    c->at = c->count = 0;
    full = -1;
  }
  pthread_mutex_unlock(&recording);
  return nothing;
}

static ticks_t* shared; /* whose questions are command_waits */
static due_t* clocked;

/* TickQueue.serve. */
static void serve(void) {
  __atomic_store_n(&bell, 0, __ATOMIC_RELAXED);
  pthread_mutex_lock(&queue);
  const int64_t orders = ordered - fulfilled;
  fulfilled = ordered;
  if (orders) x[0] = 0.0; /* as by ~/set_joint_state */
  pthread_cond_broadcast(&served);
  pthread_mutex_unlock(&queue);
  done.orders += orders;
}

/* TickRecorder: passes a full chunk on, and takes another one; the lock is given back for a moment, as at the end of a call
 * of C. */
static void make_space(ticks_t* t) {
  pthread_mutex_lock(&recording);
  if (!t->chunk) t->chunk = chunks;
  if (t->chunk->at) {
    while (full >= 0 && !is_over()) {
      pthread_mutex_unlock(&recording);
      sched_yield();
      pthread_mutex_lock(&recording);
    }
    if (is_over()) { /* nobody takes it any more */
      clocked->ended = 1;
      t->chunk->size = CHUNK;
    } else {
      full = t->chunk - chunks;
      t->chunk = chunks + !full;
      pthread_cond_signal(&filled);
    }
  }
  pthread_mutex_unlock(&recording);
}

/* Ticks.answer. */
static int64_t answer(int64_t what) {
  if (what == SERVE) serve();
  if (what == TICKED) note(shared);
  if (what == SPACE) make_space(shared);
  return what == SPACE;
}

static void* ticking(void* of) {
  const loop_t* loop = of;
  ticks_by_the_clock(loop->ticks, loop->due);
  return NULL;
}

/* Run all threads until `count` orders are fulfilled, with ticks of `period` in [ns]. */
EXPORT void run_threads(int64_t count, int64_t period, done_t* found_out) {
  static const uint8_t any[MESSAGE];
  static const int64_t joints[JOINTS] = {0, 1};
  bell = ended = ordered = fulfilled = command_waits = 0;
  full = -1;
  memset(lateness_bins, 0, sizeof lateness_bins);
  memset(&done, 0, sizeof done);
  for (int i = 0; i < 2; ++i) chunks[i] = (chunk_t){.raw = chunk_raw[i], .places = places[i], .size = CHUNK - CHUNK / 4, .oldest = GIGA};
  histogram_t lateness = {.bins = lateness_bins}, trips = {.bins = trip_bins};
  trip_t trip = {.stamps = stamps, .times = times, .trips = &trips};
  stream_t stream = {0};
  arbiter_t arbiter = {.patience = 1000, .only = &stream};
  slot_t slot = {.timeout = NEWS, .policy = ZERO, .efforts = newest};
  joint_state_t reader = {
      .kinds = {{.mask = any, .bits = any, .size = MESSAGE, .at = {HEAD}, .index = joints}},
      .fields = 1, .joints = JOINTS, .numbers = read};
  source_t from = {0};
  const uint8_t* numbers = (uint8_t*)x;
  sink_t state = {
      .raw = state_raw, .size = MESSAGE, .fields = 1, .joints = JOINTS, .at = {HEAD}, .numbers = {numbers}};
  arm_t arm = {.tick = drive, .x = x, .command = next_command, .dt = 1e-3, .acted = acted};
  tick_t copy = {
      .raw = tick_raw, .size = MESSAGE, .stamp_at = 0, .hold_at = 8, .at = {HEAD}, .numbers = {numbers, numbers, numbers},
      .sizes = {8 * JOINTS}, .tick_channel = 1, .state_channel = 2};
  ticks_t ticks = {
      .ask = answer, .bell = &bell, .take = joint_state_take, .source = &from, .reader = &reader, .most_messages = 2, .trusted_kinds = {1},
      .arbiter = &arbiter, .slot = &slot, .arm = &arm, .x = x, .effort = acted,
      .dt = 1e-3, .joints = JOINTS, .states = JOINTS, .state_period = 1, .slow_period = 100,
      .joint_states = &state, .state_trail = kept_states, .effort_trail = kept_efforts, .ticks = kept_ticks, .rows = ROWS, .trip = &trip,
      .copy = &copy, .commands = 3};
  shared = &ticks;
  due_t due = {.deadline = time_of(CLOCK_MONOTONIC), .period = period, .longest_lag = 1000 * GIGA, .lateness = &lateness};
  loop_t loop = {&ticks, &due};
  clocked = &due;
  pthread_t threads[4];
  pthread_create(threads, NULL, writing, NULL);
  pthread_create(threads + 1, NULL, looking, &loop);
  pthread_create(threads + 2, NULL, ordering, &count);
  pthread_create(threads + 3, NULL, ticking, &loop);
  pthread_join(threads[2], NULL);
  __atomic_store_n(&due.ended, 1, __ATOMIC_RELEASE);
  pthread_join(threads[3], NULL);
  pthread_mutex_lock(&recording);
  pthread_cond_broadcast(&filled);
  pthread_mutex_unlock(&recording);
  for (int i = 0; i < 2; ++i) pthread_join(threads[i], NULL);
  note(&ticks);
  for (int64_t k = 0; k < ticks.chunk->count; ++k) done.written += ticks.chunk->raw[ticks.chunk->places[k] + 9] == 1;
  done.ticks = ticks.step_count;
  done.recorded = ticks.recorded_count;
  done.counted = count_of(&lateness);
  *found_out = done;
}
