/* SPDX-License-Identifier: Apache-2.0
 *
 * Ordinary answers of the controller: read a state, evaluate the reference and a compiled controller, publish the
 * command. Any other state is passed to Python unchanged, which alone decides on it. See compiled_answers.py for the callers.
 */
#include "answers.h"

#include "sample.h"

#include <math.h>
#include <pthread.h>
#include <rcutils/error_handling.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SPEED_RATIO 2.0 /* largest ratio of the speed of a displacement to the speeds before and after it */
#define SHORT_SILENCE (GIGA / 2) /* silence in [ns] after which Python decides whom to follow */
#define FULL_TURN 6.283185307179586 /* 2 π */

struct receiver {
  pthread_mutex_t lock; /* held while a state is answered, or while Python uses the parts of the controller */
  sem_t calls;          /* posted for every state left to `receiver_serve`, and at the end */
  atomic_bool ended;
  answers_t* at_once; /* answers of states on the thread that brings them; NULL: `receiver_serve` answers all */
  int64_t pending_outcome; /* outcome for a state that was taken on that thread and is left to Python; NONE: none */
  const rcl_subscription_t* subscription;
};

static int64_t now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return GIGA * t.tv_sec + t.tv_nsec;
}

int64_t is_repeated(const last_message_t* last, const uint8_t* raw, int64_t length) {
  return length && length == last->length && !memcmp(raw, last->raw, length);
}

void remember_state(last_message_t* last, const uint8_t* raw, int64_t length) {
  memcpy(last->raw, raw, length);
  last->length = length;
}

int64_t find_jump(const state_t* b, int64_t n, int64_t stamp, const double* q, const double* v, double gap, double far) {
  if (!b->valid) return STEADY;
  const double passed = 1e-9 * (double)(stamp - b->stamp);
  if (passed < 0.0) return BACKWARDS;
  if (gap > 0.0 && passed > gap) return PAUSED;
  for (int64_t i = 0; far > 0.0 && i < n; ++i)
    if (fabs(q[i] - b->q[i]) > far + SPEED_RATIO * passed * fmax(fabs(b->v[i]), fabs(v[i]))) return MOVED + i;
  return STEADY;
}

void note_state(state_t* b, int64_t n, int64_t stamp, const double* q, const double* v) {
  if (b->valid && stamp - b->stamp > b->longest) b->longest = stamp - b->stamp;
  b->valid = 1;
  b->stamp = stamp;
  memcpy(b->q, q, 8 * n);
  memcpy(b->v, v, 8 * n);
}

static double position_error(const double* motion, int64_t n, const int64_t* turning, int64_t joint) {
  const double error = motion[2 * n + joint] - motion[joint];
  return turning[joint] ? remainder(error, FULL_TURN) : error;
}

void find_errors(const double* motion, int64_t n, const int64_t* turning, double* errors) {
  for (int64_t i = 0; i < n; ++i) {
    errors[i] = position_error(motion, n, turning, i);
    errors[n + i] = motion[3 * n + i] - motion[n + i];
  }
}

int64_t is_within(const double* motion, int64_t n, const tolerance_t* allowed) {
  for (int64_t i = 0; i < n; ++i) {
    if (fabs(position_error(motion, n, allowed->turning, i)) > allowed->position[i]) return 0;
    if (fabs(motion[3 * n + i] - motion[n + i]) > allowed->velocity[i]) return 0;
  }
  return 1;
}

/* Compute torque and command; 0: the torque is not finite, or beyond its limit. */
static int compute(answers_t* a) {
  const entry_t* law = a->law;
  const double* v = a->input + a->joints;
  law->function(law->arguments, law->results, law->integers, law->reals, 0);
  for (int64_t i = 0; i < a->joints; ++i) {
    const double tau = a->torque[i];
    if (!isfinite(tau) || (a->limit && fabs(tau) > a->limit[i])) return 0;
    a->command[i] = a->gain ? a->gain[i] * tau + a->back_emf[i] * v[i] : tau;
  }
  return 1;
}

int64_t report_publish(report_t* r, int64_t stamp, int64_t n, const double* motion, const double* torque) {
  const double *q = motion, *v = q + n, *reference = v + n;
  const double* parts[ARRAYS] = {reference, reference + n, reference + 2 * n, q, v, NULL, NULL, torque};
  size_t subscribers = 0;
  if (stamp < r->due) return 0;
  rcl_ret_t code = rcl_publisher_get_subscription_count(r->publisher, &subscribers);
  r->due = stamp + r->period;
  if (code == RCL_RET_OK && !subscribers) return 0;
  for (int k = 0; k < ARRAYS; ++k)
    if (parts[k]) memcpy(r->raw + r->at[k], parts[k], 8 * n);
  for (int64_t i = 0; i < 2 * n; ++i) {
    const double error = reference[i] - q[i];
    memcpy(r->raw + r->at[5 + i / n] + 8 * (i % n), &error, 8);
  }
  const double left = r->duration - 1e-9 * (double)(stamp - r->start), remaining = left > 0.0 ? left : 0.0;
  memcpy(r->raw + r->at[ARRAYS], &remaining, 8);
  code = publish_serialized(r->publisher, r->raw, r->size, stamp);
  if (code != RCL_RET_OK) r->due = stamp;
  return code;
}

/* Register the answer to a state. */
static void note_answer(answers_t* a, const joint_state_t* s, int64_t stamp, int64_t began) {
  const int64_t n = a->joints;
  note_state(a->previous, n, stamp, a->input, a->input + n);
  memcpy(a->tau, a->torque, 8 * n);
  memcpy(a->memory, a->next_memory, 8 * a->memory_size);
  remember_state(a->last_message, s->raw, s->length);
  a->last_time = now();
  const int64_t duration = a->last_time - began;
  a->total_time += duration;
  if (duration > a->longest_time) a->longest_time = duration;
  ++a->count;
}

/* Answer the state that was read last; 0: Python must answer it. */
static int answer(answers_t* a, int64_t began) {
  const joint_state_t* s = a->reader;
  const int64_t n = a->joints, stamp = s->stamp;
  if (!a->active || __atomic_load_n(&a->interrupt, __ATOMIC_ACQUIRE)) return 0;
  memcpy(a->input, s->numbers, 16 * n);
  if (stamp >= a->until || s->length > a->last_message->room || is_repeated(a->last_message, s->raw, s->length)) return 0;
  if (find_jump(a->previous, n, stamp, a->input, a->input + n, a->gap_limit, a->jump_limit) != STEADY) return 0;
  const double t = 1e-9 * (double)(stamp - a->start);
  trajectory_sample(n, a->segments, a->knots, a->polynomials, a->ends, a->torques, t, a->input + 2 * n);
  if ((a->path && stamp >= a->path_begin && !is_within(a->input, n, a->path)) || !compute(a)) return 0;
  if (joint_state_send(a->sink, stamp)) {
    a->last_message->length = 0; /* the sink no longer holds its answer */
    return 0;
  }
  /* Python tries again, and says why, if it fails. */
  if (report_publish(a->report, stamp, n, a->input, a->torque)) __atomic_store_n(&a->interrupt, 1, __ATOMIC_RELEASE);
  note_answer(a, s, stamp, began);
  return 1;
}

void receiver_lock(receiver_t* r) { pthread_mutex_lock(&r->lock); }

void receiver_unlock(receiver_t* r) { pthread_mutex_unlock(&r->lock); }

/* Whether a state is of another publisher than the one that is followed, which was heard lately. */
static int is_of_another(publishers_t* f, const uint8_t* sender, int64_t now) {
  const int is_same = !memcmp(f->sender, sender, GID);
  if (is_same) f->last_time = now;
  if (is_same || now - f->last_time >= SHORT_SILENCE) return 0;
  f->other_time = now;
  memcpy(f->other, sender, GID);
  return 1;
}

/* Take a state and answer it; the outcome of `joint_state_take` if Python must answer it, else NONE. */
static int64_t take_and_answer(answers_t* a) {
  const int64_t began = now(), outcome = joint_state_take(a->source, a->reader);
  return outcome == KNOWN && (is_of_another(a->publishers, a->reader->sender, began) || answer(a, began)) ? NONE : outcome;
}

int64_t receiver_serve(receiver_t* r, answers_t* a, int64_t direct) {
  r->at_once = direct ? a : NULL;
  for (;;) {
    receiver_unlock(r);
    while (sem_wait(&r->calls)) continue; /* interrupted by a signal */
    receiver_lock(r);
    if (r->ended) return ENDED;
    int64_t outcome = r->pending_outcome;
    r->pending_outcome = NONE;
    if (outcome == NONE) outcome = take_and_answer(a);
    if (outcome != NONE) return outcome;
  }
}

/* Answer a new state unless someone else uses the parts; 0: it is left to `receiver_serve`. */
static int answer_at_once(receiver_t* r) {
  if (pthread_mutex_trylock(&r->lock)) return 0;
  const int is_ready = r->at_once && !r->ended && r->pending_outcome == NONE;
  if (is_ready) r->pending_outcome = take_and_answer(r->at_once);
  const int is_answered = is_ready && r->pending_outcome == NONE;
  receiver_unlock(r);
  return is_answered;
}

/* Called by ROS when states arrive, on a thread of the middleware. */
static void on_new_state(const void* receiver, size_t count) {
  receiver_t* r = (receiver_t*)receiver;
  (void)count;
  if (!answer_at_once(r)) sem_post(&r->calls);
}

void receiver_end(receiver_t* r) {
  r->ended = 1;
  sem_post(&r->calls);
}

void receiver_free(receiver_t* r) {
  if (rcl_subscription_set_on_new_message_callback(r->subscription, NULL, NULL) != RCL_RET_OK) rcutils_reset_error();
  sem_destroy(&r->calls);
  pthread_mutex_destroy(&r->lock);
  free(r);
}

receiver_t* receiver_create(const rcl_subscription_t* subscription) {
  pthread_mutexattr_t kind;
  receiver_t* r = calloc(1, sizeof *r);
  if (!r) return NULL;
  r->subscription = subscription;
  sem_init(&r->calls, 0, 0);
  pthread_mutexattr_init(&kind);
  pthread_mutexattr_settype(&kind, PTHREAD_MUTEX_RECURSIVE);
  pthread_mutexattr_setprotocol(&kind, PTHREAD_PRIO_INHERIT); /* the states' thread may have real-time priority */
  pthread_mutex_init(&r->lock, &kind);
  pthread_mutexattr_destroy(&kind);
  if (rcl_subscription_set_on_new_message_callback(subscription, on_new_state, r) == RCL_RET_OK) return r;
  rcutils_reset_error();
  receiver_free(r);
  return NULL;
}
