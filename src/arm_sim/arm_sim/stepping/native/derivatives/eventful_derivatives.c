/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of a tick across its events: those of the smooth segments that the engine has traced, times those of the events
 * between them. See derivatives/linearization.py.
 */

#include "derivatives/guard_derivatives.h"
#include "derivatives/impact_derivatives.h"
#include "derivatives/rest_derivatives.h"

#ifndef EXPORTED
#define EXPORTED __attribute__((visibility("default")))
#endif
#define SATISFIED 1e-12 /* change of a state by closing contacts that were closed to rounding */

/* Functions from elsewhere: of the engine; of a smooth step with NX + NW + 1 rows of columns, by x, what is held, and its
 * length; and derivatives of an end by the end, the beginning and tunable quantities, wherever it is. */
typedef struct {
  int (*trace_tick)(const double* x, const double* u, const double* p, double h, void* control, trace_t* trace, double* after);
  void (*carry_step)(const double* x, const double* u, const double* p, const double* h, const double* given, long long count,
                     double* after, double* columns);
  void (*close)(const double* end, const double* p, const double* begin, double* slopes);
} helpers_t;

/* Numbers in a segment that is recorded. */
EXPORTED long long record_numbers(void) { return sizeof(record_t) / sizeof(double); }

/* A motion and its derivatives, and those of the time that has passed. */
typedef struct {
  real x[NX], slope[NX][NV], delay[NV];
} motion_t;

/* A contact that starts to slide, or comes to rest without turning: there a small lateral force changes the direction
 * arbitrarily fast. */
static enum refusal check_sliding(const tick_t* tick, const record_t* segment, const record_t* following) {
  __extension__ real place[3 * NC], speed[3 * NC], size[NC], mobility[NC];
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t *mode = segment->p.contact + k, *next = following->p.contact + k;
    if (mode->closed == 0.0 || mode->sticks != 0.0 || !(friction[k] > 0.0)) continue;
    CALL(contact_geometry, (segment->end), (place, speed, size));
    const int stops = next->sticks != 0.0 && hypot(speed[3 * k + 1], speed[3 * k + 2]) <= SLOWEST;
    if (mode->fixed == 0.0 && !stops) continue;
    CALL(across, (segment->begin, tick->u, numbers(&segment->p)), (mobility));
    if (mobility[k] > 0.0) return refuse(tick, stops ? STOPS_STRAIGHT : STARTS_TO_SLIDE, k);
  }
  return NO_REFUSAL;
}

/* Take the derivatives of the end of a segment onto closed contacts and the anchors of sticking ones; `begun` are those of its
 * beginning. Where the end does not satisfy them yet, the projection itself is differentiated. */
static void close_end(const helpers_t* helpers, const record_t* segment, const real (*begun)[NV], motion_t* motion) {
  real slopes[2 * NU * (4 * NU + NT)], closed[2 * NU][NV];
  real *by_begin = slopes, *by_end = slopes + 2 * NU * 2 * NU, *by_p = by_end + 2 * NU * 2 * NU;
  memset(slopes, 0, sizeof slopes);
  if (segment->off < SATISFIED) CALL(closing, (segment->begin, motion->x, numbers(&segment->p)), (by_begin, by_end));
  else helpers->close(motion->x, numbers(&segment->p), segment->begin, slopes);
  memset(closed, 0, sizeof closed);
  add_product(2 * NU, 2 * NU, by_end, (const real(*)[NV])motion->slope, closed);
  add_product(2 * NU, 2 * NU, by_begin, begun, closed);
  for (int i = 0; i < 2 * NU; ++i)
    for (int j = 0; j < NT; ++j) closed[i][NX + NU + j] += by_p[j * 2 * NU + i];
  memcpy(motion->slope, closed, sizeof closed);
}

/* Refuse a tick that begins or ends with an event, or on the boundary of a mode. */
static enum refusal check_ends(const tick_t* tick, const trace_t* trace, int begins) {
  const record_t *first = trace->records, *last = first + trace->count - 1;
  if (first->hit != 0.0) return BEGINS_WITH_IMPACT;
  if (find_boundaries(first->begin, tick, first)) return BEGINS_ON_BOUNDARY;
  if (find_boundaries(last->end, tick, last)) return ENDS_ON_BOUNDARY;
  enum refusal refused = check_rest(tick, first, begins);
  for (const record_t* each = first; NC && each <= last && !refused; ++each)
    refused = check_sliding(tick, each, each < last ? each + 1 : each);
  return refused;
}

/* Derivatives of the state with which a segment begins, after its impact and with what is held at rest. */
static enum refusal begin_motion(const tick_t* tick, const record_t* segment, motion_t* motion) {
  const enum refusal refused = (NC || RIGID) && segment->hit != 0.0 ? pass_impact(tick, segment, motion->slope) : NO_REFUSAL;
  if (refused) return refused;
  memcpy(motion->x, segment->begin, sizeof motion->x);
  if (NK) lead_back(tick, segment, motion->slope);
  real matrix[NX * NX], begun[NX][NV];
  if (all_moves((const double*)&segment->p + NP)) return NO_REFUSAL;
  CALL(at_rest, (segment->begin, tick->u, numbers(&segment->p)), (matrix));
  memset(begun, 0, sizeof begun);
  add_product(NX, NX, matrix, (const real(*)[NV])motion->slope, begun);
  memcpy(motion->slope, begun, sizeof begun);
  return NO_REFUSAL;
}

/* Move over the steps of a segment; `speed` receives the derivative of its end by the length of the last. */
static void take_steps(const helpers_t* helpers, const tick_t* tick, const record_t* segment, const double* steps,
                       motion_t* motion, real* speed) {
  for (int k = 0; k < segment->steps; ++k) {
    real given[NX + NW + 1][NV + 1], moved[NX][NV + 1], x[NX];
    memset(given, 0, sizeof given);
    for (int i = 0; i < NX; ++i) memcpy(given[i], motion->slope[i], sizeof motion->slope[i]);
    for (int i = NX; i <= NV; ++i) given[i][i] = 1.0;
    memcpy(x, motion->x, sizeof x);
    helpers->carry_step(x, tick->u, numbers(&segment->p), steps + k, given[0], NV + 1, motion->x, moved[0]);
    for (int i = 0; i < NX; ++i) {
      memcpy(motion->slope[i], moved[i], sizeof motion->slope[i]);
      speed[i] = moved[i][NV];
    }
  }
}

/* Move over a segment and the events that begin and end it; `last`: whether it is that of the tick. */
static enum refusal pass_segment(const helpers_t* helpers, const tick_t* tick, const record_t* segment, const double* steps,
                                 int last, motion_t* motion) {
  real begun[NX][NV], speed[NX], delay[NV];
  enum refusal refused = begin_motion(tick, segment, motion);
  if (refused) return refused;
  memcpy(begun, motion->slope, sizeof begun);
  memset(speed, 0, sizeof speed);
  memset(delay, 0, sizeof delay);
  take_steps(helpers, tick, segment, steps, motion, speed);
  if (last)
    for (int j = 0; j < NV; ++j) delay[j] = -motion->delay[j];
  else if (segment->event_free == 0.0) refused = find_delay(tick, segment, (const real(*)[NV])motion->slope, speed, delay);
  for (int i = 0; i < NX; ++i)
    for (int j = 0; j < NV; ++j) motion->slope[i][j] += speed[i] * delay[j];
  for (int j = 0; j < NV; ++j) motion->delay[j] += delay[j];
  if (NC && any_closed(segment)) close_end(helpers, segment, (const real(*)[NV])begun, motion);
  return refused;
}

/* Derivatives by state, command before its limits, and tunable quantities, from those by what acts. */
static void pass_limits(const motion_t* motion, const real* u_x, const real* u_r, double* slope) {
  for (int i = 0; i < NX; ++i) {
    const real *row = motion->slope[i], *by_u = row + NX;
    double* to = slope + i * NV;
    for (int j = 0; j < NX; ++j) to[j] = row[j] + product_of(NU, by_u, u_x + j * NU);
    for (int j = 0; j < NU; ++j) to[NX + j] = product_of(NU, by_u, u_r + j * NU);
    for (int j = NX + NU; j < NV; ++j) to[j] = row[j];
  }
}

/* Make a tick of length h from x under the command r and differentiate it: why that is not possible, enum refusal.
 *
 * control: error control, or null; it advances.           begins: whether the state is itself varied, see rest_derivatives.h.
 * strict:  whether to refuse a tick that begins or ends on the boundary of a mode.
 * trace:   room for its segments and steps.               which:  receives how many and what a refusal is about, 1 + NG numbers.
 * after:   receives the state at the end.                 slope:  receives derivatives, NX rows of NV, or null.
 */
EXPORTED int differentiate(const helpers_t* helpers, const double* x, const double* r, const double* p, double h,
                           void* control, int strict, int begins, trace_t* trace, long long* which, double* after,
                           double* slope) {
  real u[NU], u_x[NU * NX], u_r[NU * NU];
  const tick_t tick = {u, h, which};
  motion_t motion;
  enum refusal refused = NO_REFUSAL;
  which[0] = trace->count = trace->taken = 0;
  CALL(acting, (x, r), (u, u_x, u_r));
  if (!helpers->trace_tick(x, u, p, h, control, trace, after) || trace->taken > trace->most_steps) return DIVERGES;
  if (trace->time_stepped || trace->count > trace->most) return ACCUMULATE;
  for (int i = 0; i < NX; ++i)
    if (BEYOND(after[i], LARGEST)) return DIVERGES;
  if (!slope) return NO_REFUSAL;
  if (strict) refused = check_ends(&tick, trace, begins);
  memset(&motion, 0, sizeof motion);
  for (int i = 0; i < NX; ++i) motion.slope[i][i] = 1.0;
  const double* steps = trace->steps;
  for (long long k = 0; k < trace->count && !refused; ++k) {
    const record_t* segment = trace->records + k;
    refused = pass_segment(helpers, &tick, segment, steps, k == trace->count - 1, &motion);
    steps += (long long)segment->steps;
  }
  if (!refused) pass_limits(&motion, u_x, u_r, slope);
  return refused;
}
