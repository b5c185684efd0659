/* SPDX-License-Identifier: Apache-2.0
 *
 * Services that run without Python. Python reads this header, see compiled_services.py.
 */
#pragma once
#include <rcl/service.h>
#include <stdint.h>

#include "entry.h"

enum { INVERSE, FORWARD, ALL_TERMS, SERVICES };
enum { ENDED = -1 }; /* else the index of a service that Python must answer */

/* A generated function of many points, see rows.c. */
typedef void (*rows_t)(const double* const* inputs, const long long* steps, long long rows, double* const* outputs);

/* The function that computes a service's response, and its data. */
typedef struct {
  rows_t rows;           /* NULL: none; Python answers */
  void* response;        /* with all fields that are constant across requests */
  const char* const* names;
  int64_t joints, max_points; /* number of joints, and largest number of points of a request */
  const double* level;   /* positive for joints that may stick at rest; NULL: none may */
  const double* zeros;   /* in place of absent vectors */
} answer_t;

/* Numbers of requests answered, of responses that could not be sent, since the client is gone, and time spent on
 * answers in [ns]. */
typedef struct {
  int64_t answered, lost, busy;
} counts_t;

typedef struct server server_t;

/* A server of services, in the order of the enumeration, with memory for one request of each; NULL: out of memory, or
 * ROS does not report calls. */
EXPORT server_t* server_create(const rcl_service_t* const* services, void* const* requests);

/* Run services until Python must answer a request, which stays pending until the next call; returns its index, or ENDED
 * once `server_end` has been called. One thread at a time. */
EXPORT int64_t server_serve(server_t* s);

/* Exchange the function of a service. */
EXPORT void server_set_answer(server_t* s, int64_t k, const answer_t* answer);

/* Send a response to the pending request, computed by Python. */
EXPORT void server_respond(server_t* s, int64_t k, void* response);

/* Sums over all services; for any thread. */
QUICK void server_counts(server_t* s, counts_t* sums);

/* Let `server_serve` return. */
EXPORT void server_end(server_t* s);

/* Unregister from calls and free all memory; nothing may be using it. */
EXPORT void server_free(server_t* s);
