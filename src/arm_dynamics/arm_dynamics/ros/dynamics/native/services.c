/* SPDX-License-Identifier: Apache-2.0
 *
 * Services that run without Python, from the request to the response. Unsupported or invalid requests are passed to
 * Python, which answers or rejects them. See compiled_services.py for the callers.
 */
#include "services.h"

#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <arm_msgs/srv/detail/dynamics_terms__struct.h>
#include <arm_msgs/srv/detail/forward_dynamics__struct.h>
#include <arm_msgs/srv/detail/inverse_dynamics__struct.h>
#include <rcutils/error_handling.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>

#define INPUTS 3 /* largest number of vectors of a request */
#define OUTPUTS 7  /* largest number of vectors of a response */
#define TERMS 5 /* of inverse dynamics, each a bit of a request, see Term of terms/table.py */
#define LARGE 1e100 /* beyond it, overflow depends on the order of operations; Python decides */
#define ROOM 65536  /* capacity in numbers that is kept between requests */

enum { NONE, ANSWERED, FOR_PYTHON };

typedef rosidl_runtime_c__double__Sequence doubles_t;
typedef rosidl_runtime_c__String__Sequence strings_t;

/* Offsets of the vectors in a service's request and response, and the power of n of the size of each in a response. */
typedef struct {
  int inputs, outputs;
  size_t from[INPUTS], to[OUTPUTS];
  int power[OUTPUTS];
} layout_t;

#define OF(kind, part, field) offsetof(arm_msgs__srv__##kind##_##part, field)
static const layout_t LAYOUTS[SERVICES] = {
    {.inputs = 3,
     .from = {OF(InverseDynamics, Request, position), OF(InverseDynamics, Request, velocity),
              OF(InverseDynamics, Request, acceleration)},
     .outputs = 1,
     .to = {OF(InverseDynamics, Response, effort)},
     .power = {1}},
    {.inputs = 3,
     .from = {OF(ForwardDynamics, Request, position), OF(ForwardDynamics, Request, velocity),
              OF(ForwardDynamics, Request, effort)},
     .outputs = 1,
     .to = {OF(ForwardDynamics, Response, acceleration)},
     .power = {1}},
    {.inputs = 2,
     .from = {OF(DynamicsTerms, Request, position), OF(DynamicsTerms, Request, velocity)},
     .outputs = 7,
     .to = {OF(DynamicsTerms, Response, mass_matrix), OF(DynamicsTerms, Response, coriolis_matrix),
            OF(DynamicsTerms, Response, gravity), OF(DynamicsTerms, Response, friction), OF(DynamicsTerms, Response, spring),
            OF(DynamicsTerms, Response, kinetic_energy), OF(DynamicsTerms, Response, potential_energy)},
     .power = {2, 2, 1, 1, 1, 0, 0}},
};
static const size_t NAMES[SERVICES] = {OF(InverseDynamics, Request, joint_names), OF(ForwardDynamics, Request, joint_names),
                                       OF(DynamicsTerms, Request, joint_names)};

/* A service, and what answers it. */
typedef struct {
  const rcl_service_t* service;
  void* request;
  int64_t kind;
  answer_t answer;
  rmw_request_id_t header;  /* identifies the pending request */
  /* Read by other threads: number of requests, time spent on them in [ns], and responses that could not be sent, since the
   * client is gone. */
  atomic_llong answered, busy, lost;
  bool called;              /* whether requests may have arrived since the last check */
  server_t* server;
} service_t;

struct server {
  service_t services[SERVICES];
  pthread_mutex_t lock;  /* held while a service runs, or its function is exchanged */
  pthread_mutex_t calls; /* protects `called` and `ended` */
  pthread_cond_t call;
  bool ended;
  int64_t last; /* the service that was called last */
};

/* The vector of a message at an offset. */
static doubles_t* vector_at(void* message, size_t offset) { return (doubles_t*)((char*)message + offset); }

static int64_t now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1000000000LL * t.tv_sec + t.tv_nsec;
}

/* Whether the magnitude of every number is within the bound; false for NaN. */
static bool all_within(const double* x, size_t count, double limit) {
  for (size_t i = 0; i < count; ++i)
    if (!(fabs(x[i]) <= limit)) return false;
  return true;
}

/* Resize a sequence; its contents are undefined. */
static bool stretch(doubles_t* s, size_t size) {
  if (s->capacity < size) {
    rosidl_runtime_c__double__Sequence__fini(s);
    if (!rosidl_runtime_c__double__Sequence__init(s, size)) return false;
  }
  s->size = size;
  return true;
}

/* Free the memory of an exceptionally large sequence. */
static void shrink(doubles_t* s) {
  if (s->capacity > ROOM) rosidl_runtime_c__double__Sequence__fini(s);
}

/* Whether joint names are absent or in the model's order. */
static bool in_order(const strings_t* names, const answer_t* answer) {
  if (names->size == 0) return true;
  if (names->size != (size_t)answer->joints) return false;
  for (size_t i = 0; i < names->size; ++i) {
    size_t length = strlen(answer->names[i]);
    if (names->data[i].size != length || memcmp(names->data[i].data, answer->names[i], length)) return false;
  }
  return true;
}

/* Number of points of the pending request; 0: Python must answer it. */
static int64_t points_of(service_t* s, const double* inputs[INPUTS]) {
  const layout_t* layout = LAYOUTS + s->kind;
  const answer_t* answer = &s->answer;
  if (!in_order((const strings_t*)((char*)s->request + NAMES[s->kind]), answer)) return 0;
  size_t size = vector_at(s->request, layout->from[0])->size, n = answer->joints;
  if (size == 0 || size % n || size / n > (size_t)answer->max_points) return 0;
  for (int i = 0; i < layout->inputs; ++i) {
    const doubles_t* x = vector_at(s->request, layout->from[i]);
    if (x->size != size && (i == 0 || x->size)) return 0;
    if (!all_within(x->data, x->size, LARGE)) return 0;
    inputs[i] = x->size ? x->data : answer->zeros;
  }
  return size / n;
}

/* Whether a joint that may stick is at rest; Python decides which ones stick. */
static bool has_joint_at_rest(const answer_t* answer, const double* v, long long step, int64_t points) {
  if (!answer->level) return false;
  for (int64_t k = 0; k < points; ++k)
    for (int64_t i = 0; i < answer->joints; ++i)
      if (v[k * step + i] == 0.0 && answer->level[i] > 0.0) return true;
  return false;
}

/* Write the response to the pending request; false: Python must answer it. */
static bool compute_response(service_t* s) {
  const layout_t* layout = LAYOUTS + s->kind;
  answer_t* answer = &s->answer;
  const double* inputs[INPUTS + 1];
  long long steps[INPUTS + 1] = {0};
  double factors[TERMS], *outputs[OUTPUTS];
  if (!answer->rows) return false;
  int64_t points = points_of(s, inputs), sizes[OUTPUTS];
  if (!points) return false;
  for (int i = 0; i < layout->inputs; ++i) steps[i] = inputs[i] == answer->zeros ? 0 : answer->joints;
  if (s->kind == FORWARD && has_joint_at_rest(answer, inputs[1], steps[1], points)) return false;
  for (int i = 0; i < layout->outputs; ++i) {
    sizes[i] = points;
    for (int power = 0; power < layout->power[i]; ++power) sizes[i] *= answer->joints;
    if (!stretch(vector_at(answer->response, layout->to[i]), sizes[i])) return false;
    outputs[i] = vector_at(answer->response, layout->to[i])->data;
  }
  if (s->kind == INVERSE) {
    uint8_t terms = ((arm_msgs__srv__InverseDynamics_Request*)s->request)->terms;
    if (terms >> TERMS) return false;
    for (int i = 0; i < TERMS; ++i) factors[i] = terms >> i & 1;
    inputs[INPUTS] = factors;
  }
  answer->rows(inputs, steps, points, outputs);
  for (int i = 0; i < layout->outputs; ++i)
    if (!all_within(vector_at(answer->response, layout->to[i])->data, sizes[i], DBL_MAX)) return false;
  return true;
}

/* Answer the pending request. */
static void send_response(service_t* s, void* response) {
  if (rcl_send_response(s->service, &s->header, response) == RCL_RET_OK) return;
  rcutils_reset_error();
  ++s->lost;
}

/* Take a request, if there is one, and answer it, unless Python must. */
static int attend(service_t* s) {
  const layout_t* layout = LAYOUTS + s->kind;
  if (rcl_take_request(s->service, &s->header, s->request) != RCL_RET_OK) {
    rcutils_reset_error(); /* there is none, or it is malformed */
    return NONE;
  }
  int64_t began = now();
  if (!compute_response(s)) return FOR_PYTHON;
  ++s->answered;
  send_response(s, s->answer.response);
  for (int i = 0; i < layout->inputs; ++i) shrink(vector_at(s->request, layout->from[i]));
  for (int i = 0; i < layout->outputs; ++i) shrink(vector_at(s->answer.response, layout->to[i]));
  s->busy += now() - began;
  return ANSWERED;
}

/* Record that a service was called; ROS calls this on a thread that must not be blocked. */
static void register_call(const void* called, size_t count) {
  service_t* s = (service_t*)called;
  (void)count;
  pthread_mutex_lock(&s->server->calls);
  s->called = true;
  pthread_cond_signal(&s->server->call);
  pthread_mutex_unlock(&s->server->calls);
}

/* Wait for the next called service, in round-robin order after the last one; ENDED at the end. */
static int64_t await_call(server_t* s) {
  int64_t called = ENDED;
  pthread_mutex_lock(&s->calls);
  while (!s->ended && called == ENDED) {
    for (int64_t i = 1; i <= SERVICES && called == ENDED; ++i)
      if (s->services[(s->last + i) % SERVICES].called) called = (s->last + i) % SERVICES;
    if (called == ENDED) pthread_cond_wait(&s->call, &s->calls);
  }
  if (called != ENDED) s->services[s->last = called].called = false;
  pthread_mutex_unlock(&s->calls);
  return called;
}

int64_t server_serve(server_t* s) {
  for (int64_t k; (k = await_call(s)) != ENDED;) {
    pthread_mutex_lock(&s->lock);
    int outcome = attend(s->services + k);
    pthread_mutex_unlock(&s->lock);
    if (outcome != NONE) register_call(s->services + k, 1); /* there may be further requests */
    if (outcome == FOR_PYTHON) return k;
  }
  return ENDED;
}

void server_set_answer(server_t* s, int64_t k, const answer_t* answer) {
  pthread_mutex_lock(&s->lock);
  s->services[k].answer = *answer;
  pthread_mutex_unlock(&s->lock);
}

void server_respond(server_t* s, int64_t k, void* response) { send_response(s->services + k, response); }

void server_counts(server_t* s, counts_t* sums) {
  *sums = (counts_t){0};
  for (int k = 0; k < SERVICES; ++k) {
    sums->answered += s->services[k].answered;
    sums->lost += s->services[k].lost;
    sums->busy += s->services[k].busy;
  }
}

void server_end(server_t* s) {
  pthread_mutex_lock(&s->calls);
  s->ended = true;
  pthread_cond_signal(&s->call);
  pthread_mutex_unlock(&s->calls);
}

void server_free(server_t* s) {
  for (int k = 0; k < SERVICES; ++k)
    if (rcl_service_set_on_new_request_callback(s->services[k].service, NULL, NULL) != RCL_RET_OK) rcutils_reset_error();
  pthread_cond_destroy(&s->call);
  pthread_mutex_destroy(&s->calls);
  pthread_mutex_destroy(&s->lock);
  free(s);
}

server_t* server_create(const rcl_service_t* const* services, void* const* requests) {
  server_t* s = calloc(1, sizeof *s);
  if (!s) return NULL;
  pthread_mutex_init(&s->lock, NULL);
  pthread_mutex_init(&s->calls, NULL);
  pthread_cond_init(&s->call, NULL);
  for (int k = 0; k < SERVICES; ++k)
    s->services[k] = (service_t){.service = services[k], .request = requests[k], .kind = k, .server = s};
  for (int k = 0; k < SERVICES; ++k)
    if (rcl_service_set_on_new_request_callback(services[k], register_call, s->services + k) != RCL_RET_OK) {
      rcutils_reset_error();
      server_free(s);
      return NULL;
    }
  return s;
}
