/* SPDX-License-Identifier: Apache-2.0
 *
 * Services that are answered without Python, from the request to the response. What is not known here or wrong is handed
 * over, and answered or refused there: see compiled_services.py, which also says what is called by whom.
 */
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <arm_msgs/srv/detail/dynamics_terms__struct.h>
#include <arm_msgs/srv/detail/forward_dynamics__struct.h>
#include <arm_msgs/srv/detail/inverse_dynamics__struct.h>
#include <rcl/service.h>
#include <rcutils/error_handling.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>

#define EXPORT __attribute__((visibility("default")))
#define SERVICES 3
#define GIVEN 3 /* vectors of a request at most */
#define MADE 7  /* vectors of a response at most */
#define TERMS 5
#define FRICTION 3  /* bit of `terms` */
#define LARGE 1e100 /* beyond it, what overflows on the way depends on who computes: that is for Python */
#define ROOM 65536  /* numbers for which memory is kept from request to request */

enum { INVERSE, FORWARD, ALL_TERMS };
enum { NONE, ANSWERED, FOR_PYTHON };
enum { ENDED = -1 }; /* else the number of a service that Python must answer */

typedef rosidl_runtime_c__double__Sequence doubles_t;
typedef rosidl_runtime_c__String__Sequence strings_t;

/* Where the vectors of a service's request and response are, and to which power of n each of a response grows. */
typedef struct {
  int given, made;
  size_t from[GIVEN], to[MADE];
  int power[MADE];
} layout_t;

#define OF(kind, part, field) offsetof(arm_msgs__srv__##kind##_##part, field)
static const layout_t LAYOUTS[SERVICES] = {
    {3, 1,
     {OF(InverseDynamics, Request, position), OF(InverseDynamics, Request, velocity),
      OF(InverseDynamics, Request, acceleration)},
     {OF(InverseDynamics, Response, effort)}, {1}},
    {3, 1,
     {OF(ForwardDynamics, Request, position), OF(ForwardDynamics, Request, velocity),
      OF(ForwardDynamics, Request, effort)},
     {OF(ForwardDynamics, Response, acceleration)}, {1}},
    {2, 7,
     {OF(DynamicsTerms, Request, position), OF(DynamicsTerms, Request, velocity)},
     {OF(DynamicsTerms, Response, mass_matrix), OF(DynamicsTerms, Response, coriolis_matrix),
      OF(DynamicsTerms, Response, gravity), OF(DynamicsTerms, Response, friction), OF(DynamicsTerms, Response, spring),
      OF(DynamicsTerms, Response, kinetic_energy), OF(DynamicsTerms, Response, potential_energy)},
     {2, 2, 1, 1, 1, 0, 0}},
};
static const size_t NAMES[SERVICES] = {OF(InverseDynamics, Request, joint_names), OF(ForwardDynamics, Request, joint_names),
                                       OF(DynamicsTerms, Request, joint_names)};

/* A generated function of many points, see rows.c. */
typedef void (*rows_t)(const double* const* given, const long long* steps, long long rows, double* const* made);

/* What answers a service. */
typedef struct {
  rows_t rows;           /* NULL: nothing does, Python is asked */
  void* response;        /* with everything written that is the same for all requests */
  const char* const* names;
  int64_t joints, most;  /* points of a request at most */
  const double* level;   /* a joint for which it is positive may stick when it is at rest; NULL: none does */
  const double* gravity; /* in [m/s²], of inverse dynamics */
  const double* zeros;   /* for vectors that are absent */
} answer_t;

typedef struct server server_t;

typedef struct {
  const rcl_service_t* service;
  void* request;
  int64_t kind;
  answer_t answer;
  rmw_request_id_t header;  /* of the request that is here */
  int64_t answered, busy;   /* requests, and time for them in [ns] */
  atomic_llong lost;        /* responses that could not be sent: who asked is gone */
  bool called;              /* whether requests may have come since the last look */
  server_t* server;
} service_t;

struct server {
  service_t services[SERVICES];
  pthread_mutex_t lock;  /* held while a service is answered, or what answers it is exchanged */
  pthread_mutex_t calls; /* held for `called` and `ended` */
  pthread_cond_t call;
  bool ended;
};

static doubles_t* of(void* message, size_t place) { return (doubles_t*)((char*)message + place); }

static int64_t now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1000000000LL * t.tv_sec + t.tv_nsec;
}

/* Whether all numbers are at most that large; one that is none is not. */
static bool all_within(const double* x, size_t count, double limit) {
  for (size_t i = 0; i < count; ++i)
    if (!(fabs(x[i]) <= limit)) return false;
  return true;
}

/* Make a sequence as long as that; its numbers are anything. */
static bool stretch(doubles_t* s, size_t size) {
  if (s->capacity < size) {
    rosidl_runtime_c__double__Sequence__fini(s);
    if (!rosidl_runtime_c__double__Sequence__init(s, size)) return false;
  }
  s->size = size;
  return true;
}

/* Give the memory of a giant back. */
static void shrink(doubles_t* s) {
  if (s->capacity > ROOM) rosidl_runtime_c__double__Sequence__fini(s);
}

/* Whether joints are named in the model's order, or not at all. */
static bool in_order(const strings_t* names, const answer_t* answer) {
  if (names->size == 0) return true;
  if (names->size != (size_t)answer->joints) return false;
  for (size_t i = 0; i < names->size; ++i) {
    size_t length = strlen(answer->names[i]);
    if (names->data[i].size != length || memcmp(names->data[i].data, answer->names[i], length)) return false;
  }
  return true;
}

/* Points of the request that is here; 0 if it is for Python. */
static int64_t points_of(service_t* s, const double* given[GIVEN]) {
  const layout_t* layout = LAYOUTS + s->kind;
  const answer_t* answer = &s->answer;
  if (!in_order((const strings_t*)((char*)s->request + NAMES[s->kind]), answer)) return 0;
  size_t size = of(s->request, layout->from[0])->size, n = answer->joints;
  if (size == 0 || size % n || size / n > (size_t)answer->most) return 0;
  for (int i = 0; i < layout->given; ++i) {
    const doubles_t* x = of(s->request, layout->from[i]);
    if (x->size != size && (i == 0 || x->size)) return 0;
    if (!all_within(x->data, x->size, LARGE)) return 0;
    given[i] = x->size ? x->data : answer->zeros;
  }
  return size / n;
}

/* Whether a joint that may stick is at rest: which do is for Python. */
static bool rests(const answer_t* answer, const double* v, long long step, int64_t points) {
  if (!answer->level) return false;
  for (int64_t k = 0; k < points; ++k)
    for (int64_t i = 0; i < answer->joints; ++i)
      if (v[k * step + i] == 0.0 && answer->level[i] > 0.0) return true;
  return false;
}

/* Write the response to the request that is here; false: Python must. */
static bool answered(service_t* s) {
  const layout_t* layout = LAYOUTS + s->kind;
  answer_t* answer = &s->answer;
  const double* given[GIVEN + 2];
  long long steps[GIVEN + 2] = {0};
  double weights[TERMS], *made[MADE + 1] = {NULL};
  if (!answer->rows) return false;
  int64_t points = points_of(s, given), sizes[MADE];
  if (!points) return false;
  for (int i = 0; i < layout->given; ++i) steps[i] = given[i] == answer->zeros ? 0 : answer->joints;
  if (s->kind == FORWARD && rests(answer, given[1], steps[1], points)) return false;
  for (int i = 0; i < layout->made; ++i) {
    sizes[i] = points;
    for (int power = 0; power < layout->power[i]; ++power) sizes[i] *= answer->joints;
    if (!stretch(of(answer->response, layout->to[i]), sizes[i])) return false;
    made[i] = of(answer->response, layout->to[i])->data;
  }
  if (s->kind == INVERSE) {
    uint8_t terms = ((arm_msgs__srv__InverseDynamics_Request*)s->request)->terms;
    if (terms >> TERMS) return false;
    for (int i = 0; i < TERMS; ++i) weights[i] = terms >> i & 1;
    given[GIVEN] = weights;
    given[GIVEN + 1] = answer->gravity;
    if (terms >> FRICTION & 1) { /* the second result is with friction */
      made[1] = made[0];
      made[0] = NULL;
    }
  }
  answer->rows(given, steps, points, made);
  for (int i = 0; i < layout->made; ++i)
    if (!all_within(of(answer->response, layout->to[i])->data, sizes[i], DBL_MAX)) return false;
  return true;
}

static void send(service_t* s, rmw_request_id_t* to, void* response) {
  if (rcl_send_response(s->service, to, response) == RCL_RET_OK) return;
  rcutils_reset_error();
  ++s->lost;
}

/* Take a request, if there is one, and answer it, unless that is for Python. */
static int attend(service_t* s) {
  const layout_t* layout = LAYOUTS + s->kind;
  if (rcl_take_request(s->service, &s->header, s->request) != RCL_RET_OK) {
    rcutils_reset_error(); /* there is none, or it is damaged */
    return NONE;
  }
  int64_t began = now();
  if (!answered(s)) return FOR_PYTHON;
  ++s->answered;
  send(s, &s->header, s->answer.response);
  for (int i = 0; i < layout->given; ++i) shrink(of(s->request, layout->from[i]));
  for (int i = 0; i < layout->made; ++i) shrink(of(s->answer.response, layout->to[i]));
  s->busy += now() - began;
  return ANSWERED;
}

/* Note that a service was called; ROS does so on a thread that must not be kept. */
static void note(const void* called, size_t count) {
  service_t* s = (service_t*)called;
  (void)count;
  pthread_mutex_lock(&s->server->calls);
  s->called = true;
  pthread_cond_signal(&s->server->call);
  pthread_mutex_unlock(&s->server->calls);
}

/* Wait for the next service that was called, in turn after `last`; ENDED at the end. */
static int64_t next(server_t* s, int64_t last) {
  int64_t found = ENDED;
  pthread_mutex_lock(&s->calls);
  while (!s->ended && found == ENDED) {
    for (int64_t i = 1; i <= SERVICES && found == ENDED; ++i)
      if (s->services[(last + i) % SERVICES].called) found = (last + i) % SERVICES;
    if (found == ENDED) pthread_cond_wait(&s->call, &s->calls);
  }
  if (s->ended) found = ENDED;
  if (found != ENDED) s->services[found].called = false;
  pthread_mutex_unlock(&s->calls);
  return found;
}

/* Answer services until one has a request for Python, which stays until this is called again; then its number, or ENDED once
 * `end` has been called. One thread at a time. */
EXPORT int64_t serve(server_t* s) {
  for (int64_t k = SERVICES - 1; (k = next(s, k)) != ENDED;) {
    pthread_mutex_lock(&s->lock);
    int done = attend(s->services + k);
    pthread_mutex_unlock(&s->lock);
    if (done != NONE) note(s->services + k, 1); /* there may be more of them */
    if (done == FOR_PYTHON) return k;
  }
  return ENDED;
}

/* Exchange what answers a service. */
EXPORT void use(server_t* s, int64_t k, const answer_t* answer) {
  pthread_mutex_lock(&s->lock);
  s->services[k].answer = *answer;
  pthread_mutex_unlock(&s->lock);
}

/* Send a response of Python's. */
EXPORT void respond(server_t* s, int64_t k, const rmw_request_id_t* header, void* response) {
  rmw_request_id_t to = *header;
  send(s->services + k, &to, response);
}

/* Let `serve` return. */
EXPORT void end(server_t* s) {
  pthread_mutex_lock(&s->calls);
  s->ended = true;
  pthread_cond_signal(&s->call);
  pthread_mutex_unlock(&s->calls);
}

/* Hear of no calls any more, and give everything back; nothing may be using it. */
EXPORT void release(server_t* s) {
  for (int k = 0; k < SERVICES; ++k)
    if (rcl_service_set_on_new_request_callback(s->services[k].service, NULL, NULL) != RCL_RET_OK) rcutils_reset_error();
  pthread_cond_destroy(&s->call);
  pthread_mutex_destroy(&s->calls);
  pthread_mutex_destroy(&s->lock);
  free(s);
}

/* A server of services, in the order of the enumeration, with memory for a request of each; NULL if there is no memory, or
 * ROS does not tell of calls. */
EXPORT server_t* server(const rcl_service_t* const* services, void* const* requests) {
  server_t* s = calloc(1, sizeof *s);
  if (!s) return NULL;
  pthread_mutex_init(&s->lock, NULL);
  pthread_mutex_init(&s->calls, NULL);
  pthread_cond_init(&s->call, NULL);
  for (int k = 0; k < SERVICES; ++k)
    s->services[k] = (service_t){.service = services[k], .request = requests[k], .kind = k, .server = s};
  for (int k = 0; k < SERVICES; ++k)
    if (rcl_service_set_on_new_request_callback(services[k], note, s->services + k) != RCL_RET_OK) {
      rcutils_reset_error();
      release(s);
      return NULL;
    }
  return s;
}
