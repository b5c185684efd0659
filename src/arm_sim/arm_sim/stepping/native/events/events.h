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
 * a tick has taken most_work, the rest of it is time-stepped: modes are chosen at the beginning of a step, and violations
 * are corrected at its end, without rebound, as in Moreau's scheme (Jean, "The non-smooth contact dynamics method", Comput.
 * Methods Appl. Mech. Eng. 177, 1999). That is of first order, and reported.
 */

#pragma once
#include "events/impact.h"
#include "events/sliding_direction.h"
#include "events/event_free.h"
#include "events/held.h"
#include "events/segments.h"
#include "motion/stops.h"

#define CORRECTIONS 10   /* corrections of penetrations, or of contacts that set joints in motion */
#define LEAST_PART 1e-6 /* fraction of such a correction below which it is not applied */
#define MORE_STEPS (scene->constrained ? 100 : 0) /* further ones of a linkage, which may hop between its stops ever faster */
#define END_HALVINGS 50 /* bisections to find where its joints end */
#define TIME_STEPS 4 /* steps into which the rest of a time-stepped tick is divided */
#define MOST_TRAVEL 1e6 /* longest motion of a joint in such a step [rad] or [m] */
#define MOST_REBOUNDS 500 /* impacts with loss in one tick after which contacts no longer rebound */

static int is_inside(const scene_t* scene, const real* x, const segment_t* segment) {
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  int inside = 0;
  find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) inside |= geometry.place[3 * k] < -scene->deep;
  return inside;
}

/* Whether a joint moves against its sliding direction, as contacts that were brought to rest may cause. */
static int turns_back(const scene_t* scene, const real* x, const segment_t* segment) {
  const double rounding = turning_rounding(scene, x);
  int any = 0;
  for (int i = 0; i < ND; ++i) any |= may_stick(scene, i) && x[NU + i] * segment->p.direction[i] < -rounding;
  return any;
}

/* Choose the modes at x, after impacts, and correct x for them; `losses` are the impacts with loss in this tick, and `anchor`
 * receives the positions of sticking points.
 */
static enum trouble begin_segment(const scene_t* scene, real* x, segment_t* segment, double tick, long long* losses,
                                  report_t* report, real* anchor) {
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  real before[NU];
  int hit = 0;
  for (int i = 0; i < NU; ++i) before[i] = x[NU + i];
  const double lost = impact(scene, x, segment, *losses < MOST_REBOUNDS, &geometry);
  for (int i = 0; i < NU; ++i) hit |= x[NU + i] != before[i]; /* an elastic impact loses no energy */
  if (stop_rounding(scene, x)) find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) segment->contact[k].slow = 0;
  if (lost < 0.0 || !solve_modes(scene, x, segment, &geometry)) return UNDETERMINED;
  if (mark_slow_contacts(scene, x, segment, tick)) {
    if (!solve_modes(scene, x, segment, &geometry)) return UNDETERMINED;
    stop_reversed_contacts(scene, x, segment);
    find_geometry(scene, x, segment, &geometry);
  }
  report->impact_loss += lost;
  report->impacts += hit;
  *losses += lost > 0.0;
  find_anchors(scene, &geometry, anchor);
  for (int turn = 0; turn < CORRECTIONS; ++turn) {
    if (is_off(scene, x, segment, &geometry)) {
      close_contacts(scene, x, segment, anchor);
      rest_touching(scene, x, segment, anchor);
    }
    if (!turns_back(scene, x, segment)) break;
    find_geometry(scene, x, segment, &geometry);
    if (!solve_modes(scene, x, segment, &geometry)) return UNDETERMINED;
  }
  return NONE;
}

/* Correct penetrations of planes and stops, and stop joints that reversed although they should have come to rest. Velocities
 * into planes and stops are kept, since the impact that removes them accounts for their energy.
 */
static void correct_penetrations(const scene_t* scene, real* x, const segment_t* segment) {
  LOCAL_MODES(modes, segment->p);
  segment_t caught = *segment;
  caught.p = modes;
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  real anchor[2 * NC + 1], v[NU];
  for (int i = 0; i < ND; ++i)
    if (may_stick(scene, i) && x[NU + i] * segment->p.direction[i] <= 0.0) x[NU + i] = 0.0;
  copy(v, x + NU, NU);
  find_geometry(scene, x, segment, &geometry);
  find_anchors(scene, &geometry, anchor);
  for (int k = 0; k < NC; ++k)
    if (geometry.place[3 * k] < 0.0) caught.p.contact[k].closed = 1.0;
  for (int turn = 0; turn < CORRECTIONS; ++turn) {
    stop_at_limits(scene, x);
    for (int i = 0; i < ND; ++i)
      if (at_stop(scene, x, i)) caught.p.direction[i] = 0.0; /* a correction must not pass a stop */
    close_contacts(scene, x, &caught, anchor);
    if (turn > 0 && !is_inside(scene, x, segment)) break;
  }
  for (int i = 0; i < NU; ++i) x[NU + i] = v[i];
}

/* Limit the motion from x such that no point is inside a plane, where penetrations cannot be corrected. */
static void limit_penetration(const scene_t* scene, const real* x, const segment_t* segment, real* after) {
  real end[NU];
  double part = 1.0;
  for (int i = 0; i < NU; ++i) end[i] = after[i];
  while (is_inside(scene, after, segment)) {
    part = part > LEAST_PART ? 0.5 * part : 0.0;
    for (int i = 0; i < NU; ++i) after[i] = x[i] + part * (end[i] - x[i]);
    if (part == 0.0) break;
  }
}

/* Whether a step takes a joint farther than any joint goes: an unstable method made its speed grow. */
static int exceeds_travel(const scene_t* scene, const piece_t* piece) {
  double farthest = 0.0;
  for (int i = 0; i < NU; ++i) farthest = fmax(farthest, fabs(piece->end[i] - piece->begin[i]));
  return farthest > MOST_TRAVEL;
}

/* Whether a joint is beyond its stop, or moves against its sliding direction. */
static int passes_end(const scene_t* scene, const real* x, const segment_t* segment) {
  LOCAL(guard_values_t, guards, guard_values_of, GUARD_VALUES);
  fill(scene, &guards, -INFINITY);
  guarded_t at;
  at.x = x;
  at.segment = segment;
  at.t = 0.0;
  evaluate_stop_guards(scene, &at, &guards);
  return largest_among(guards.stop, 2 * NU) > 0.0 || (ND && turns_back(scene, x, segment));
}

/* Shorten a step that takes a joint beyond the end of its motion: its length, -1 if it cannot be computed. In a linkage the
 * joint cannot be stopped alone afterwards, since that would open the loops.
 */
static double shorten(const scene_t* scene, const segment_t* segment, double h, piece_t* piece) {
  double low = 0.0, high = h;
  real error[2];
  if (!scene->constrained || !passes_end(scene, piece->end, segment)) return h;
  for (int k = 0; k < END_HALVINGS; ++k) {
    const double middle = 0.5 * (low + high);
    if (make_step(scene, segment, middle, piece, error) && !passes_end(scene, piece->end, segment)) low = middle;
    else high = middle;
  }
  copy(piece->end, piece->begin, NX);
  return low == 0.0 || make_step(scene, segment, low, piece, error) ? low : -1.0;
}

/* The rest of a tick in a few steps of fixed length, in place; of a linkage also shorter ones, to where joints end. */
static enum trouble step_through(const scene_t* scene, real* x, segment_t* segment, double left, report_t* report) {
  long long losses = MOST_REBOUNDS;
  double rest = left;
  segment->step = left / TIME_STEPS;
  for (int k = 0; k < TIME_STEPS + MORE_STEPS && (!scene->constrained || rest > 0.0); ++k) {
    real after[NX], anchor[2 * NC + 1], error[2];
    LOCAL(piece_t, piece, piece_of, PIECE);
    const enum trouble trouble = begin_segment(scene, x, segment, left, &losses, report, anchor);
    if (trouble != NONE) return trouble;
    copy(piece.begin, x, NX);
    begin_piece(scene, segment, &piece);
    const double h = scene->constrained ? fmin(segment->step, rest) : segment->step;
    if (!make_step(scene, segment, h, &piece, error) || exceeds_travel(scene, &piece)) return NUMBERS;
    const double length = shorten(scene, segment, h, &piece);
    if (length < 0.0) return NUMBERS;
    rest -= length;
    copy(after, piece.end, NX);
    close_contacts(scene, after, segment, anchor);
    correct_penetrations(scene, after, segment);
    limit_penetration(scene, x, segment, after);
    for (int i = 0; i < NX; ++i) x[i] = after[i];
  }
  return scene->constrained && rest > LEAST_PART * left ? UNDETERMINED : NONE;
}

/* The next record of a traced tick, which begins at x; null if there is no room. */
static record_t* next_record(const scene_t* scene, trace_t* trace, const real* x) {
  if (!trace || trace->count++ >= trace->most) return 0;
  record_t* record = trace->records + trace->count - 1;
  *record = record_of(scene, trace->numbers + (trace->count - 1) * RECORD);
  record->event_free = 1;
  copy(record->before, x, NX);
  return record;
}

static void record_begin(const scene_t* scene, record_t* record, const segment_t* segment, const real* x) {
  if (!record) return;
  copy(record->p.tunable, segment->p.tunable, P_LENGTH);
  for (int k = 0; k < NC; ++k) record->limit[k] = stick_limit(scene, segment, k);
  for (int i = 0; i < NX; ++i) record->begin[i] = x[i];
}

static void record_end(const scene_t* scene, record_t* record, const real* x, double length, int event_free) {
  if (!record) return;
  record->length = length;
  record->event_free = event_free;
  for (int i = 0; i < NX; ++i) record->end[i] = x[i];
}

static enum trouble tick_with_events(const scene_t* scene, const real* x, segment_t* segment, double h, report_t* report,
                                     trace_t* trace, real* now) {
  long long losses = 0;
  double left = h;
  for (int i = 0; i < NX; ++i) now[i] = x[i];
  if (is_inside(scene, now, segment)) return INSIDE;
  segment->trace = trace;
  while (segment->memory->work < scene->most_work) {
    real after[NX], anchor[2 * NC + 1];
    int event_free;
    record_t* record = segment->record = next_record(scene, trace, now);
    const enum trouble trouble = begin_segment(scene, now, segment, h, &losses, report, anchor);
    if (trouble != NONE) return trouble;
    fix_straight_contacts(scene, now, segment, h);
    const double reach = fmin(left, find_reach(scene, segment, h));
    record_begin(scene, record, segment, now);
    if (NX == 2 * NU && is_held(scene, now, segment)) { /* a drive with internal states may still break it loose */
      for (int i = NU; i < NX; ++i) now[i] = 0.0;
      record_end(scene, record, now, left, 1);
      record_step(segment, left);
      return NONE;
    }
    const double length = advance_segment(scene, now, segment, reach, after, &event_free);
    if (length < 0.0) return NUMBERS;
    record_end(scene, record, after, length, event_free);
    find_ended_modes(scene, after, segment, event_free);
    close_contacts(scene, after, segment, anchor);
    for (int i = 0; record && i < 2 * NU; ++i) record->off = fmax(record->off, fabs(after[i] - record->end[i]));
    if (!stop_joints(scene, after, segment)) return NUMBERS;
    stop_at_limits(scene, after);
    for (int i = 0; i < NX; ++i) now[i] = after[i];
    if ((event_free && reach == left) || left - length <= 0.0) return NONE;
    left -= length;
  }
  ++report->time_stepped;
  return step_through(scene, now, segment, left, report);
}

/* Whether no joint may meet a stop in a motion to `next`, and no drive or cord switch: whether each moves by less than half of its
 * distance; and beforehand, whether none is so close to a stop that no step away from stops need be tried. */
static int stays_free(const scene_t* scene, const real* x, const real* u, const real* next, double h) {
  int meets = 0;
  for (int i = 0; i < NU; ++i)
    meets |= meets_stop(scene, x[i], x[NU + i], next ? next[i] : x[i], next ? next[NU + i] : 0.0, h, 0.0, i);
  if (!NK || !next || meets) return !meets;
  LOCAL(segment_t, segment, segment_of, SEGMENT);
  real value[2][NK + 1], size[NK + 1];
  segment.u = u;
  find_switches(scene, x, &segment, value[0], size);
  find_switches(scene, next, &segment, value[1], size);
  for (int k = 0; k < NK; ++k) {
    const double a = value[0][k], b = value[1][k];
    meets |= !(fabs(b - a) < 0.5 * fmin(fabs(a), fabs(b)) || (a == b && fabs(a) > SWITCH_ROUNDING * size[k]));
  }
  return !meets;
}

/* Whether every joint is held. */
static int holds_all(const scene_t* scene, const real* modes) {
  int all = ND > 0;
  for (int i = 0; i < ND; ++i) all &= modes[i] == 0.0;
  return all;
}

/* What is known at the beginning of a tick that may have an event: where its contacts are, or loads in modes of sliding and held
 * joints. */
typedef struct {
  real *p, *place;
  loads_t load;
  int holds;
} beginning_t;
#define BEGINNING (P_LENGTH + PLACES + LOADS)

static beginning_t beginning_of(const scene_t* scene, real* numbers) {
  beginning_t begun = {numbers, numbers + P_LENGTH, loads_of(scene, numbers + P_LENGTH + PLACES), 0};
  return begun;
}

/* A tick that clearly has no event, in which all joints slide or are held and no contact touches: 0 if it may have one. */
static int event_free_shortcut(const scene_t* scene, const real* x, const real* u, const real* p, double h, beginning_t* begun,
                               real* after) {
  real place_after[PLACES + 1];
  LOCAL(step_of_lanes_t, made, step_of_lanes_of, STEP_OF_LANES);
  find_places(scene, x, begun->place);
  const real begins = begins_event_free(scene, x, u, p, begun->place, begun->p, begun->load.load, &begun->holds);
  if (begins == 0.0 || (begun->holds && NX > 2 * NU)) return 0;
  const int still = begun->holds && holds_all(scene, begun->p + NP);
  if (!still
      && stays_event_free(scene, x, u, &h, begun->place, begun->p, begun->load.load, begun->holds, &made, place_after) == 0.0)
    return 0;
  copy(after, still ? x : made.next, NX);
  rest_held(scene, after);
  return 1;
}

static int tick(const scene_t* scene, const real* x, const real* u, const real* p, double h, control_t* control,
                report_t* report, real* after) {
  LOCAL(beginning_t, begun, beginning_of, BEGINNING);
  report->trouble = NONE;
  if (scene->free && flow(scene, scene->free_step, scene->free_attempt, stays_free, x, u, p, h, control, after)) return 1;
  if (scene->event_free_shortcut && event_free_shortcut(scene, x, u, p, h, &begun, after)) return 1;
  LOCAL_TICK(segment, u);
  segment.control = control;
  copy(segment.p.tunable, p, NP);
  if (scene->event_free_shortcut && NC) keep_geometry(scene, x, &memory, begun.place);
  else if (begun.holds)
    keep_loads(scene, x, begun.p + NP, &memory, &begun.load); /* in modes without contacts, as the engine's */
  report->trouble = tick_with_events(scene, x, &segment, h, report, 0, after);
  return report->trouble == NONE;
}

/* Whether a contact point is inside its plane. */
static int is_penetrated(const scene_t* scene, const real* x) {
  LOCAL_TICK(segment, 0);
  return is_inside(scene, x, &segment);
}

/* Find the probable modes of a tick. */
EXPORTED void predict(const void* of, prediction_t* tick) {
  const scene_t* scene = (const scene_t*)of;
  LOCAL_TICK(segment, tick->u);
  geometry_t geometry = geometry_of(scene, tick->geometry);
  copy(segment.p.tunable, tick->p, P_LENGTH);
  guess_modes(scene, tick->x, &segment, &geometry);
  find_anchors(scene, &geometry, tick->anchor);
  copy(tick->p, segment.p.tunable, P_LENGTH);
  tick->rests = anything_rests(scene, tick->x, &segment);
  tick->closes = tick->slides = 0;
  for (int k = 0; k < NC; ++k) {
    tick->closes |= segment.p.contact[k].closed != 0.0;
    tick->slides |= scene->friction[k] > 0.0 && is_sliding(segment.p.contact + k);
  }
}

/* A predicted tick: NONE, or why it cannot be computed. */
static enum trouble make_predicted(const scene_t* scene, const prediction_t* tick, report_t* report, trace_t* trace,
                                   double* after) {
  LOCAL_TICK(segment, tick->u);
  segment.predicted = tick;
  copy(segment.p.tunable, tick->p, NP);
  return tick_with_events(scene, tick->x, &segment, tick->length, report, trace, after);
}

/* The predicted tick, whatever happens in it: 0 if it cannot be computed. */
EXPORTED int predicted_tick(const void* of, const prediction_t* tick, double* after) {
  const scene_t* scene = (const scene_t*)of;
  report_t report = {0.0, 0, 0, 0};
  return make_predicted(scene, tick, &report, 0, after) == NONE;
}

/* The predicted tick without events: 0 if there is one, or it cannot be computed. */
EXPORTED int event_free_tick(const void* of, const prediction_t* tick, event_free_t* found) {
  const scene_t* scene = (const scene_t*)of;
  report_t report = {0.0, 0, 0, 0};
  real numbers[RECORD];
  record_t record;
  trace_t trace = {&record, numbers, 0, 1, 0, 0, 0, 0};
  if (make_predicted(scene, tick, &report, &trace, found->after) != NONE) return 0;
  if (trace.count != 1 || !record.event_free || record.hit || report.time_stepped) return 0;
  copy(found->p, record.p.tunable, P_LENGTH);
  copy(found->grip, record.limit, NC);
  copy(found->begin, record.begin, NX);
  copy(found->end, record.end, NX);
  return within_reach(scene, found->after);
}

/* One traced tick: 0 if it cannot be computed. */
EXPORTED int trace_tick(const scene_t* scene, const real* x, const real* u, const real* p, double h, control_t* control,
                        trace_t* trace, real* after) {
  report_t report = {0.0, 0, 0, 0};
  LOCAL_TICK(segment, u);
  segment.control = control;
  copy(segment.p.tunable, p, NP);
  const enum trouble trouble = tick_with_events(scene, x, &segment, h, &report, trace, after);
  trace->time_stepped = report.time_stepped;
  return trouble == NONE;
}
