/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of a tick across its events: those of the smooth segments that the engine has traced, times those of the events
 * between them (saltation matrices). See derivatives/linearization.py.
 */

#include "arm/traced_tick.h"
#include "derivatives/impact_derivatives.h"
#include "derivatives/rest_stability.h"
#include "derivatives/switch_derivatives.h"
#include "derivatives/tangents.h"

#define GRAZING_RATE 1e-4   /* rate of a guard that grazes zero, relative to that at the beginning */
#define DELAY_ROUNDING 1e-9 /* relative difference of the derivatives of an event's time that is none */

/* What the engine does not know. */
typedef struct {
  const scene_t* tick_scene;  /* scene of the engine, whose ticks are traced */
  const scene_t* step_scene;  /* scene of propagate_step */
  const tangents_t* tangents; /* functions of propagate_step */
  /* A smooth step and its columns of tangents, NX + NW + 1 rows: by x, command and tunable quantities, and its length. */
  void (*propagate_step)(const scene_t* scene, const tangents_t* tangents, const double* x, const double* u, const double* p,
                         const double* h, const double* columns_before, long long count, double* after, double* columns);
  /* Derivatives of a segment's closed end, wherever its end is: by its beginning, by its end, and by tunable quantities, each
   * column by column with 2 NU rows. */
  void (*differentiate_closing)(const double* end, const double* p, const double* begin, double* slopes);
} helpers_t;

/* Numbers in the arrays of a recorded segment. */
EXPORTED long long numbers_recorded(const scene_t* scene) { return RECORD; }

/* Bytes of a recorded segment without its arrays. */
EXPORTED long long bytes_of_record(void) { return sizeof(record_t); }

/* A motion: its state, the derivatives of the state, and the derivative of the event's time. */
typedef struct {
  real *all, *x, *slope, *delay;
} motion_t;
#define MOTION (NX + NX * NV + NV)

static motion_t motion_of(const scene_t* scene, real* numbers) {
  motion_t motion = {numbers, numbers, numbers + NX, numbers + NX + NX * NV};
  return motion;
}

/* The derivatives of a motion by rows. */
#define ROWS(motion) ((real(*)[NV])(motion)->slope)

/* Refuse a contact that starts to slide, or comes to rest without turning: there a small lateral force changes the direction
 * arbitrarily fast. */
static enum refusal check_sliding(const scene_t* scene, const tick_t* tick, const record_t* segment,
                                  const record_t* following) {
  real place[3 * NC + 1], speed[3 * NC + 1], size[NC + 1], mobility[NC + 1];
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t *mode = segment->p.contact + k, *next = following->p.contact + k;
    if (mode->closed == 0.0 || mode->sticks != 0.0 || !(scene->friction[k] > 0.0)) continue;
    CALL(scene->contact_geometry, (segment->motion_end), (place, speed, size));
    const int comes_to_rest = next->sticks != 0.0 && hypot(speed[3 * k + 1], speed[3 * k + 2]) <= scene->slowest;
    if (mode->fixed == 0.0 && !comes_to_rest) continue;
    CALL(scene->across, (segment->motion_begin, tick->u, segment->p.all), (mobility));
    if (mobility[k] > 0.0) return refuse(tick, comes_to_rest ? STOPS_STRAIGHT : STARTS_TO_SLIDE, k);
  }
  return NO_REFUSAL;
}

/* Take the derivatives of the end of a segment onto closed contacts and the anchors of sticking ones; `at_begin` are those of
 * its beginning. Where the end does not satisfy them yet, the projection itself is differentiated. */
static void close_end(const scene_t* scene, const helpers_t* helpers, const record_t* segment, const real (*at_begin)[NV],
                      motion_t* motion) {
  real slopes[2 * NU * (4 * NU + NT)];
  real *by_begin = slopes, *by_end = slopes + 2 * NU * 2 * NU, *by_p = by_end + 2 * NU * 2 * NU;
  clear(slopes, 2 * NU * (4 * NU + NT));
  if (segment->closing_change < CLOSING_ROUNDING)
    CALL(scene->closing, (segment->motion_begin, motion->x, segment->p.all), (by_begin, by_end));
  else helpers->differentiate_closing(motion->x, segment->p.all, segment->motion_begin, slopes);
  multiply_rows(scene, 2 * NU, by_end, ROWS(motion));
  add_product(scene, 2 * NU, 2 * NU, by_begin, at_begin, ROWS(motion));
  for (int i = 0; i < 2 * NU; ++i)
    for (int j = 0; j < NT; ++j) ROWS(motion)[i][NX + NU + j] += by_p[j * 2 * NU + i];
}

/* Refuse a tick that begins or ends with an event, or on the boundary of a mode. */
static enum refusal check_ends(const scene_t* scene, const tick_t* tick, const trace_t* trace, int state_varied) {
  const record_t *first = trace->records, *last = first + trace->count - 1;
  if (first->has_impact) return BEGINS_WITH_IMPACT;
  if (find_boundaries(scene, first->motion_begin, tick, first)) return BEGINS_ON_BOUNDARY;
  if (find_boundaries(scene, last->motion_end, tick, last)) return ENDS_ON_BOUNDARY;
  enum refusal refused = check_rest(scene, tick, first, state_varied);
  for (const record_t* each = first; NC && each <= last && !refused; ++each)
    refused = check_sliding(scene, tick, each, each < last ? each + 1 : each);
  return refused;
}

/* Derivatives of the state with which a segment begins, after its impact and with what is held at rest. */
static enum refusal begin_motion(const scene_t* scene, const tick_t* tick, const record_t* segment, motion_t* motion) {
  const enum refusal refused =
      (NC || scene->rigid) && segment->has_impact ? pass_impact(scene, tick, segment, ROWS(motion)) : NO_REFUSAL;
  if (refused) return refused;
  copy(motion->x, segment->motion_begin, NX);
  if (NK) lead_back_to_switches(scene, tick, segment, ROWS(motion));
  if (all_moves(scene, segment->p.all)) return NO_REFUSAL;
  real matrix[NX * NX];
  CALL(scene->at_rest, (segment->motion_begin, tick->u, segment->p.all), (matrix));
  multiply_rows(scene, NX, matrix, ROWS(motion));
  return NO_REFUSAL;
}

/* Derivative of the length of a segment that a guard ends, from that of its end at constant length, and by the length. */
static void follow_guard(const scene_t* scene, int guard, const tick_t* tick, const record_t* segment, const real (*slope)[NV],
                         const real* speed, real* delay) {
  real by_x[NX], change[NV], guard_rate = 0.0;
  find_change(scene, guard, segment->motion_end, tick, segment, slope, by_x, change);
  for (int i = 0; i < NX; ++i) guard_rate += by_x[i] * speed[i];
  for (int j = 0; j < NV; ++j) delay[j] = -change[j] / guard_rate;
}

/* Find the derivative of the length of a segment that an event ends, whichever it is. Joints of a loop come to rest together:
 * that is one event. */
static enum refusal find_delay(const scene_t* scene, const tick_t* tick, const record_t* segment, const real (*slope)[NV],
                               const real* speed, real* delay) {
  LOCAL(guards_t, begin, guards_of, GUARDS);
  LOCAL(guards_t, end, guards_of, GUARDS);
  double spread = 0.0, largest = 0.0;
  tick->subjects[0] = 0;
  /* A switch that does not change the motion, such as that of a current that leaves its limit, is no event. */
  if (segment->length <= TIME_ROUNDING * tick->length)
    return find_boundaries(scene, segment->motion_begin, tick, segment) ? SAME_INSTANT : NO_REFUSAL;
  find_guards(scene, segment->motion_begin, tick, segment, &begin);
  find_guards(scene, segment->motion_end, tick, segment, &end);
  find_zero(scene, &end, segment->motion_end, tick, segment, tick->subjects);
  const long long count = tick->subjects[0], *zero = tick->subjects + 1;
  if (!count) return GRAZES;
  for (int k = 0; k < count; ++k)
    if (!(fabs(end.rate[zero[k]]) > GRAZING_RATE * fabs(begin.rate[zero[k]]))) return GRAZES;
  real delays[NG][NV];
  for (int k = 0; k < count; ++k) follow_guard(scene, (int)zero[k], tick, segment, slope, speed, delays[k]);
  for (int j = 0; j < NV; ++j) {
    double low = delays[0][j], high = low;
    for (int k = 0; k < count; ++k) {
      low = fmin(low, delays[k][j]);
      high = fmax(high, delays[k][j]);
      largest = fmax(largest, fabs(delays[k][j]));
    }
    spread = fmax(spread, high - low);
    delay[j] = delays[0][j];
  }
  return spread > DELAY_ROUNDING * largest ? COINCIDE : NO_REFUSAL;
}

/* Move over the steps of a segment; `speed` receives the derivative of its end by the length of the last. */
static void take_steps(const scene_t* scene, const helpers_t* helpers, const tick_t* tick, const record_t* segment,
                       const double* steps, motion_t* motion, real* speed) {
  for (long long k = 0; k < segment->steps; ++k) {
    real before[NX + NW + 1][NV + 1], moved[NX][NV + 1], x[NX];
    memset(before, 0, sizeof before);
    for (int i = 0; i < NX; ++i) copy(before[i], ROWS(motion)[i], NV);
    for (int i = NX; i <= NV; ++i) before[i][i] = 1.0;
    copy(x, motion->x, NX);
    helpers->propagate_step(helpers->step_scene, helpers->tangents, x, tick->u, segment->p.all, steps + k, before[0], NV + 1,
                            motion->x, moved[0]);
    for (int i = 0; i < NX; ++i) {
      copy(ROWS(motion)[i], moved[i], NV);
      speed[i] = moved[i][NV];
    }
  }
}

/* Move over a segment and the events that begin and end it; `last`: whether it is that of the tick. */
static enum refusal pass_segment(const scene_t* scene, const helpers_t* helpers, const tick_t* tick, const record_t* segment,
                                 const double* steps, int last, motion_t* motion) {
  real at_begin[NX][NV], speed[NX], delay[NV];
  enum refusal refused = begin_motion(scene, tick, segment, motion);
  if (refused) return refused;
  memcpy(at_begin, motion->slope, sizeof at_begin);
  memset(speed, 0, sizeof speed);
  memset(delay, 0, sizeof delay);
  take_steps(scene, helpers, tick, segment, steps, motion, speed);
  if (last)
    for (int j = 0; j < NV; ++j) delay[j] = -motion->delay[j];
  else if (!segment->event_free) refused = find_delay(scene, tick, segment, (const real(*)[NV])motion->slope, speed, delay);
  for (int i = 0; i < NX; ++i)
    for (int j = 0; j < NV; ++j) ROWS(motion)[i][j] += speed[i] * delay[j];
  for (int j = 0; j < NV; ++j) motion->delay[j] += delay[j];
  if (any_closed(scene, segment->p.all)) close_end(scene, helpers, segment, (const real(*)[NV])at_begin, motion);
  return refused;
}

/* Derivatives by state, command before its limits, and tunable quantities, from those by what acts. */
static void pass_limits(const scene_t* scene, const motion_t* motion, const real* u_x, const real* u_r, double* slope) {
  for (int i = 0; i < NX; ++i) {
    const real *row = ROWS(motion)[i], *by_u = row + NX;
    double* to = slope + i * NV;
    for (int j = 0; j < NX; ++j) to[j] = row[j] + dot(by_u, u_x + j * NU, NU);
    for (int j = 0; j < NU; ++j) to[NX + j] = dot(by_u, u_r + j * NU, NU);
    for (int j = NX + NU; j < NV; ++j) to[j] = row[j];
  }
}

/* Make a tick of length h from x under the command r and differentiate it: NO_REFUSAL, or why that is not possible.
 *
 * control:      error control, or null; it advances.
 * strict:       whether to refuse a tick that begins or ends on the boundary of a mode.
 * state_varied: whether the state is itself varied, see rest_stability.h.
 * trace:        room for its segments and steps.
 * subjects:     receives how many and what a refusal is about, 1 + NG numbers.
 * after:        receives the state at the end.
 * slope:        receives derivatives, NX rows of NV, or null.
 */
EXPORTED int differentiate(const scene_t* scene, const helpers_t* helpers, const double* x, const double* r, const double* p,
                           double h, control_t* control, int strict, int state_varied, trace_t* trace, long long* subjects,
                           double* after, double* slope) {
  real u[NU], u_x[NU * NX], u_r[NU * NU];
  const tick_t tick = {u, h, subjects};
  LOCAL(motion_t, motion, motion_of, MOTION);
  enum refusal refused = NO_REFUSAL;
  subjects[0] = trace->count = trace->step_count = trace->time_stepped = 0;
  CALL(scene->acting, (x, r), (u, u_x, u_r));
  if (!trace_tick(helpers->tick_scene, x, u, p, h, control, trace, after)) return DIVERGES;
  if (trace->time_stepped || trace->count > trace->capacity) return ACCUMULATE;
  if (trace->step_count > trace->step_capacity) return TOO_MANY_STEPS;
  if (!within_reach(scene, after)) return DIVERGES;
  if (!slope) return NO_REFUSAL;
  if (strict) refused = check_ends(scene, &tick, trace, state_varied);
  clear(motion.all, MOTION);
  for (int i = 0; i < NX; ++i) ROWS(&motion)[i][i] = 1.0;
  const double* steps = trace->steps;
  for (long long k = 0; k < trace->count && !refused; ++k) {
    const record_t* segment = trace->records + k;
    refused = pass_segment(scene, helpers, &tick, segment, steps, k == trace->count - 1, &motion);
    steps += segment->steps;
  }
  if (!refused) pass_limits(scene, &motion, u_x, u_r, slope);
  return refused;
}
