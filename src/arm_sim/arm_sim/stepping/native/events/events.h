/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks with events: smooth segments between touch-downs, lift-offs, slips, stops and break-aways.
 *
 * Between two events each joint slides in one direction or sticks, and each contact is open, slides or sticks; the equation
 * is as smooth as without friction and contact, so the method keeps its order, and the instants are located to rounding
 * (Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, 1996). The acceleration of a sticking joint is exactly
 * zero, so its position does not change by a bit. Joints alone are the case of no contacts.
 *
 * Where events accumulate, as when a ball comes to rest, locating all of them would take too long. Once
 * a tick has taken MOST_WORK, the rest of it is time-stepped: modes are chosen at the beginning of a step, and violations
 * are corrected at its end, without rebound, as in Moreau's scheme (Jean, "The non-smooth contact dynamics method", Comput.
 * Methods Appl. Mech. Eng. 177, 1999). That is of first order, and reported.
 */

#pragma once
#include "events/event_free.h"
#include "events/segments.h"
#include "motion/stops.h"

#define CORRECTIONS 10   /* corrections of penetrations, or of contacts that set joints in motion */
#define LEAST_PART 1e-6 /* fraction of such a correction below which it is not applied */
#define MORE_STEPS (NB ? 100 : 0) /* further ones of a linkage, which may hop between its stops ever faster */
#define END_HALVINGS 50 /* bisections to find where its joints end */
#define TIME_STEPS 4 /* steps into which the rest of a time-stepped tick is divided */
#define MOST_TRAVEL 1e6 /* longest motion of a joint in such a step [rad] or [m] */
#define MOST_REBOUNDS 500 /* impacts with loss in one tick after which contacts no longer rebound */

static int is_inside(const real* x, const segment_t* segment) {
  geometry_t geometry;
  int inside = 0;
  find_geometry(x, segment, &geometry);
  for (int k = 0; k < NC; ++k) inside |= geometry.place[3 * k] < -DEEP;
  return inside;
}

/* Whether a joint moves against its sliding direction, as contacts that were brought to rest may cause. */
static int turns_back(const real* x, const segment_t* segment) {
  const double rounding = turning_rounding(x);
  int any = 0;
  for (int i = 0; i < ND; ++i) any |= may_stick(i) && x[NU + i] * segment->p.direction[i] < -rounding;
  return any;
}

/* Choose the modes at x, after impacts, and correct x for them; `losses` are the impacts with loss in this tick, and `anchor`
 * receives the positions of sticking points.
 */
static enum trouble begin_segment(real* x, segment_t* segment, double tick, long long* losses, report_t* report,
                                  real* anchor) {
  geometry_t geometry;
  real before[NU];
  int hit = 0;
  for (int i = 0; i < NU; ++i) before[i] = x[NU + i];
  const double lost = impact(x, segment, *losses < MOST_REBOUNDS, &geometry);
  for (int i = 0; i < NU; ++i) hit |= x[NU + i] != before[i]; /* an elastic impact loses no energy */
  if (stop_rounding(x)) find_geometry(x, segment, &geometry);
  for (int k = 0; k < NC; ++k) segment->contact[k].slow = 0;
  if (lost < 0.0 || !solve_modes(x, segment, &geometry)) return UNDETERMINED;
  if (find_slow(x, segment, tick)) {
    if (!solve_modes(x, segment, &geometry)) return UNDETERMINED;
    align(x, segment);
    find_geometry(x, segment, &geometry);
  }
  report->impact_loss += lost;
  report->impacts += hit;
  *losses += lost > 0.0;
  find_anchors(&geometry, anchor);
  for (int turn = 0; turn < CORRECTIONS; ++turn) {
    if (is_off(x, segment, &geometry)) {
      close_contacts(x, segment, anchor);
      rest_touching(x, segment, anchor);
    }
    if (!turns_back(x, segment)) break;
    find_geometry(x, segment, &geometry);
    if (!solve_modes(x, segment, &geometry)) return UNDETERMINED;
  }
  return NONE;
}

/* Correct penetrations of planes and stops, and stop joints that reversed although they should have come to rest. Velocities
 * into planes and stops are kept, since the impact that removes them accounts for their energy.
 */
static void correct_penetrations(real* x, const segment_t* segment) {
  segment_t caught = *segment;
  geometry_t geometry;
  __extension__ real anchor[2 * NC], v[NU];
  for (int i = 0; i < ND; ++i)
    if (may_stick(i) && x[NU + i] * segment->p.direction[i] <= 0.0) x[NU + i] = 0.0;
  for (int i = 0; i < NU; ++i) v[i] = x[NU + i];
  find_geometry(x, segment, &geometry);
  find_anchors(&geometry, anchor);
  for (int k = 0; k < NC; ++k)
    if (geometry.place[3 * k] < 0.0) caught.p.contact[k].closed = 1.0;
  for (int turn = 0; turn < CORRECTIONS; ++turn) {
    stop_at_limits(x);
    for (int i = 0; i < ND; ++i)
      if (at_stop(x, i)) caught.p.direction[i] = 0.0; /* a correction must not pass a stop */
    close_contacts(x, &caught, anchor);
    if (turn > 0 && !is_inside(x, segment)) break;
  }
  for (int i = 0; i < NU; ++i) x[NU + i] = v[i];
}

/* Limit the motion from x such that no point is inside a plane, where penetrations cannot be corrected. */
static void limit_penetration(const real* x, const segment_t* segment, real* after) {
  real end[NU];
  double part = 1.0;
  for (int i = 0; i < NU; ++i) end[i] = after[i];
  while (is_inside(after, segment)) {
    part = part > LEAST_PART ? 0.5 * part : 0.0;
    for (int i = 0; i < NU; ++i) after[i] = x[i] + part * (end[i] - x[i]);
    if (part == 0.0) break;
  }
}

/* Whether a step takes a joint farther than any joint goes: an unstable method made its speed grow. */
static int exceeds_travel(const piece_t* piece) {
  double farthest = 0.0;
  for (int i = 0; i < NU; ++i) farthest = fmax(farthest, fabs(piece->end[i] - piece->begin[i]));
  return farthest > MOST_TRAVEL;
}

/* Whether a joint is beyond its stop, or moves against its sliding direction. */
static int passes_end(const real* x, const segment_t* segment) {
  guard_values_t guards;
  fill(&guards, -INFINITY);
  evaluate_stop_guards(x, segment, 0.0, &guards);
  return largest_among(guards.stop, 2 * NU) > 0.0 || (ND && turns_back(x, segment));
}

/* Shorten a step that takes a joint beyond the end of its motion: its length, -1 if it cannot be computed. In a linkage the
 * joint cannot be stopped alone afterwards, since that would open the loops.
 */
static double shorten(const segment_t* segment, double h, piece_t* piece) {
  double low = 0.0, high = h;
  real error[2];
  if (!NB || !passes_end(piece->end, segment)) return h;
  for (int k = 0; k < END_HALVINGS; ++k) {
    const double middle = 0.5 * (low + high);
    if (make_step(segment, middle, piece, error) && !passes_end(piece->end, segment)) low = middle;
    else high = middle;
  }
  memcpy(piece->end, piece->begin, sizeof piece->end);
  return low == 0.0 || make_step(segment, low, piece, error) ? low : -1.0;
}

/* The rest of a tick in a few steps of fixed length, in place; of a linkage also shorter ones, to where joints end. */
static enum trouble step_through(real* x, segment_t* segment, double left, report_t* report) {
  long long losses = MOST_REBOUNDS;
  double rest = left;
  segment->step = left / TIME_STEPS;
  for (int k = 0; k < TIME_STEPS + MORE_STEPS && (!NB || rest > 0.0); ++k) {
    __extension__ real after[NX], anchor[2 * NC], error[2];
    piece_t piece;
    const enum trouble trouble = begin_segment(x, segment, left, &losses, report, anchor);
    if (trouble != NONE) return trouble;
    memcpy(piece.begin, x, sizeof piece.begin);
    begin_piece(segment, &piece);
    const double h = NB ? fmin(segment->step, rest) : segment->step;
    if (!make_step(segment, h, &piece, error) || exceeds_travel(&piece)) return NUMBERS;
    const double length = shorten(segment, h, &piece);
    if (length < 0.0) return NUMBERS;
    rest -= length;
    memcpy(after, piece.end, sizeof piece.end);
    close_contacts(after, segment, anchor);
    correct_penetrations(after, segment);
    limit_penetration(x, segment, after);
    for (int i = 0; i < NX; ++i) x[i] = after[i];
  }
  return NB && rest > LEAST_PART * left ? UNDETERMINED : NONE;
}

/* The next record of a traced tick, which begins at x; null if there is no room. */
static record_t* next_record(trace_t* trace, const real* x) {
  if (!trace || trace->count++ >= trace->most) return 0;
  record_t* record = trace->records + trace->count - 1;
  set_zero(record, sizeof *record);
  record->event_free = 1.0;
  for (int i = 0; i < NX; ++i) record->before[i] = x[i];
  return record;
}

static void record_begin(const segment_t* segment, const real* x) {
  record_t* record = segment->record;
  if (!record) return;
  record->p = segment->p;
  for (int k = 0; k < NC; ++k) record->limit[k] = stick_limit(segment, k);
  for (int i = 0; i < NX; ++i) record->begin[i] = x[i];
}

static void record_end(record_t* record, const real* x, double length, int event_free) {
  if (!record) return;
  record->length = length;
  record->event_free = event_free;
  for (int i = 0; i < NX; ++i) record->end[i] = x[i];
}

static void record_projection(record_t* record, const real* x) {
  for (int i = 0; record && i < 2 * NU; ++i) record->off = fmax(record->off, fabs(x[i] - record->end[i]));
}

static enum trouble tick_with_events(const real* x, segment_t* segment, double h, report_t* report, trace_t* trace,
                                     real* now) {
  long long losses = 0;
  double left = h;
  for (int i = 0; i < NX; ++i) now[i] = x[i];
  if (is_inside(now, segment)) return INSIDE;
  segment->trace = trace;
  while (segment->memory->work < most_work) {
    __extension__ real after[NX], anchor[2 * NC];
    int event_free;
    segment->record = next_record(trace, now);
    const enum trouble trouble = begin_segment(now, segment, h, &losses, report, anchor);
    if (trouble != NONE) return trouble;
    const double reach = fmin(left, find_reach(now, segment, h));
    record_begin(segment, now);
    if (NX == 2 * NU && is_held(now, segment)) { /* a drive with internal states may still break it loose */
      for (int i = NU; i < NX; ++i) now[i] = 0.0;
      record_end(segment->record, now, left, 1);
      record_step(segment, left);
      return NONE;
    }
    const double length = advance_segment(now, segment, reach, after, &event_free);
    if (length < 0.0) return NUMBERS;
    record_end(segment->record, after, length, event_free);
    find_ended_modes(after, segment, event_free);
    close_contacts(after, segment, anchor);
    record_projection(segment->record, after);
    if (!stop_joints(after, segment)) return NUMBERS;
    stop_at_limits(after);
    for (int i = 0; i < NX; ++i) now[i] = after[i];
    if ((event_free && reach == left) || left - length <= 0.0) return NONE;
    left -= length;
  }
  ++report->time_stepped;
  return step_through(now, segment, left, report);
}

/* A step of an arm away from its stops: 1 if it can be computed. */
static int free_once(const real* x, const real* u, const real* p, double h, real* after, real* error) {
  const real length = h;
  WORKSPACE;
  arg[0] = x;
  arg[1] = u;
  arg[2] = p;
  arg[3] = &length;
  res[0] = after;
  res[1] = error;
  res[2] = error + 1;
  (ADAPTIVE ? free_attempt : free_step)(arg, res, iw, w, 0);
  return within_reach(after);
}

/* Whether a joint may meet a stop in a motion, or a drive or cord switch: whether it moves by half of its distance. */
static int meets_any(const real* x, const real* u, const real* after, double h) {
  segment_t segment;
  __extension__ real value[2][NK], size[NK];
  int meets = 0;
  if (NK) set_zero(&segment, sizeof segment);
  segment.u = u;
  find_switches(x, &segment, value[0], size);
  find_switches(after, &segment, value[1], size);
  for (int k = 0; k < NK; ++k) {
    const double a = value[0][k], b = value[1][k];
    meets |= !(fabs(b - a) < 0.5 * fmin(fabs(a), fabs(b)) || (a == b && fabs(a) > SWITCH_ROUNDING * size[k]));
  }
  for (int i = 0; i < NU; ++i) meets |= meets_stop(x[i], x[NU + i], after[i], after[NU + i], h, 0.0, i);
  return meets;
}

/* Whether a joint is so close to a stop that no step away from stops need be tried. */
static int starts_near(const real* x, double h) {
  int near = 0;
  for (int i = 0; i < NU; ++i) near |= meets_stop(x[i], x[NU + i], x[i], 0.0, h, 0.0, i);
  return near;
}

/* A tick in which no joint meets a stop, without modes and under error control: 0 if one may. */
static int free_tick_controlled(const real* x, const real* u, const real* p, double h, control_t* control, real* after) {
  control_t found = *control;
  substeps_t at = first_substep(h, control->step);
  real next[NX], error[2];
  memcpy(after, x, NX * sizeof *after);
  for (long long k = 0; k < MOST_SUBSTEPS; ++k) {
    const double trial = next_length(&at, h);
    if (starts_near(after, trial)) return 0;
    const int reached = free_once(after, u, p, trial, next, error);
    const enum outcome outcome = control_step(&at, h, error[0] / control->tolerance, reached);
    ++found.attempts;
    if (outcome == STEP_TOO_SMALL) return 0;
    if (outcome == REJECTED) continue;
    if (meets_any(after, u, next, trial)) return 0;
    memcpy(after, next, sizeof next);
    found.error += error[1];
    if (outcome != ENDED) continue;
    found.step = at.step;
    *control = found;
    return 1;
  }
  return 0;
}

/* The same, in steps of fixed length or under error control. */
static int free_tick(const real* x, const real* u, const real* p, double h, control_t* control, real* after) {
  real error[2];
  if (ADAPTIVE) return free_tick_controlled(x, u, p, h, control, after);
  return !starts_near(x, h) && free_once(x, u, p, h, after, error) && !meets_any(x, u, after, h);
}

/* Whether every joint is held. */
static int holds_all(const real* modes) {
  int all = ND > 0;
  for (int i = 0; i < ND; ++i) all &= modes[i] == 0.0;
  return all;
}

/* A tick that clearly has no event, in which all joints slide or are held and no contact touches: 0 if it may have one. What
 * was computed at its beginning is kept then. */
static int event_free_shortcut(const real* x, const real* u, const real* p, double h, memory_t* memory, real* after) {
  real known[NP + MODES], place_after[PLACES + 1];
  geometry_t geometry;
  loads_t load;
  step_of_lanes_t made;
  int holds;
  const real *place = (const real*)&geometry, *known_load = (const real*)&load;
  find_places(x, (real*)&geometry);
  if (begins_event_free(x, u, p, place, known, (real*)&load, &holds) != 0.0 && !(holds && NX > 2 * NU)) {
    const int still = holds && holds_all(known + NP);
    const int event_free = still || stays_event_free(x, u, &h, place, known, known_load, holds, &made, place_after) != 0.0;
    if (event_free) {
      memcpy(after, still ? x : made.next, sizeof made.next);
      rest_held(after);
      return 1;
    }
  }
  if (NC) keep_geometry(x, memory, &geometry);
  else if (holds) keep_loads(x, known + NP, memory, &load); /* in modes that contain no contacts, as the engine's */
  return 0;
}

static int tick(const real* x, const real* u, const real* p, double h, control_t* control, report_t* report, real* after) {
  memory_t memory;
  segment_t segment;
  int done = 0;
  forget_all(&memory);
  if (FREE) done = free_tick(x, u, p, h, control, after);
  if (SHORTCUT) done = event_free_shortcut(x, u, p, h, &memory, after);
  report->trouble = NONE;
  if (done) return 1;
  begin_tick(&segment, u, &memory);
  segment.control = control;
  for (int i = 0; i < NP; ++i) segment.p.tunable[i] = p[i];
  report->trouble = tick_with_events(x, &segment, h, report, 0, after);
  return report->trouble == NONE;
}

/* Whether a contact point is inside its plane. */
static int is_penetrated(const real* x) {
  memory_t memory;
  segment_t segment;
  forget_all(&memory);
  begin_tick(&segment, 0, &memory);
  return is_inside(x, &segment);
}

/* Find the probable modes of a tick. */
EXPORTED void predict(prediction_t* tick) {
  memory_t memory;
  segment_t segment;
  geometry_t geometry;
  forget_all(&memory);
  begin_tick(&segment, tick->u, &memory);
  memcpy(&segment.p, tick->p, sizeof segment.p);
  memcpy(&geometry, tick->geometry, sizeof geometry);
  guess_modes(tick->x, &segment, &geometry);
  find_anchors(&geometry, tick->anchor);
  memcpy(tick->p, &segment.p, sizeof segment.p);
  tick->rests = anything_rests(tick->x, &segment);
  tick->closes = tick->slides = 0;
  for (int k = 0; k < NC; ++k) {
    tick->closes |= segment.p.contact[k].closed != 0.0;
    tick->slides |= friction[k] > 0.0 && is_sliding(segment.p.contact + k);
  }
}

/* A predicted tick: NONE, or why it cannot be computed. */
static enum trouble make_predicted(const prediction_t* tick, report_t* report, trace_t* trace, double* after) {
  memory_t memory;
  segment_t segment;
  set_zero(report, sizeof *report);
  forget_all(&memory);
  begin_tick(&segment, tick->u, &memory);
  segment.predicted = tick;
  memcpy(segment.p.tunable, tick->p, sizeof segment.p.tunable);
  return tick_with_events(tick->x, &segment, tick->length, report, trace, after);
}

/* The predicted tick, whatever happens in it: 0 if it cannot be computed. */
EXPORTED int predicted_tick(const prediction_t* tick, double* after) {
  report_t report;
  return make_predicted(tick, &report, 0, after) == NONE;
}

/* The predicted tick without events: 0 if there is one, or it cannot be computed. */
EXPORTED int event_free_tick(const prediction_t* tick, event_free_t* found) {
  report_t report;
  record_t record;
  trace_t trace;
  set_zero(&trace, sizeof trace);
  trace.records = &record;
  trace.most = 1;
  if (make_predicted(tick, &report, &trace, found->after) != NONE) return 0;
  if (trace.count != 1 || record.event_free == 0.0 || record.hit != 0.0 || report.time_stepped) return 0;
  memcpy(found->p, &record.p, sizeof record.p);
  memcpy(found->grip, record.limit, sizeof record.limit);
  memcpy(found->begin, record.begin, sizeof record.begin);
  memcpy(found->end, record.end, sizeof record.end);
  return within_reach(found->after);
}

/* One traced tick: 0 if it cannot be computed. */
EXPORTED int trace_tick(const real* x, const real* u, const real* p, double h, control_t* control, trace_t* trace,
                        real* after) {
  memory_t memory;
  segment_t segment;
  report_t report;
  set_zero(&report, sizeof report);
  forget_all(&memory);
  begin_tick(&segment, u, &memory);
  segment.control = control;
  memcpy(segment.p.tunable, p, sizeof segment.p.tunable);
  const enum trouble trouble = tick_with_events(x, &segment, h, &report, trace, after);
  trace->time_stepped = report.time_stepped;
  return trouble == NONE;
}
