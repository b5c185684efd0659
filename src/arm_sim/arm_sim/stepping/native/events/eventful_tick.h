/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick as segments between touch-downs, lift-offs, slips, stops and break-aways.
 *
 * Between two events each joint slides in one direction or sticks, and each contact is open, slides or sticks; the equation
 * is as smooth as without friction and contact, so the method keeps its order, and the instants are located to rounding
 * (Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, 1996). The acceleration of a sticking joint is exactly
 * zero, so its position does not change by a bit. Joints alone are the case of no contacts.
 *
 * Where events accumulate, as when a ball comes to rest, locating all of them would take too long: once a tick has taken
 * work_limit, the rest of it is time-stepped.
 */

#pragma once
#include "events/immobility.h"
#include "events/time_stepping.h"

/* The next record of a traced tick, which begins at x; null if there is no room. */
static record_t* next_record(const scene_t* scene, trace_t* trace, const real* x) {
  if (!trace || trace->count++ >= trace->capacity) return 0;
  record_t* record = trace->records + trace->count - 1;
  *record = record_of(scene, trace->numbers + (trace->count - 1) * RECORD);
  record->event_free = 1;
  copy(record->before_impact, x, NX);
  return record;
}

/* Record the modes of a segment, and the state with which its motion begins. */
static void record_begin(const scene_t* scene, record_t* record, const segment_t* segment, const real* x) {
  if (!record) return;
  copy(record->p.all, segment->p.all, P_LENGTH);
  for (int k = 0; k < NC; ++k) record->stick_limit[k] = stick_limit(scene, segment, k);
  copy(record->motion_begin, x, NX);
}

/* Record the end of a segment's motion, before its contacts are closed. */
static void record_end(const scene_t* scene, record_t* record, const real* x, double length, int event_free) {
  if (!record) return;
  record->length = length;
  record->event_free = event_free;
  copy(record->motion_end, x, NX);
}

/* Advance x by h into `now`: NONE, or why that is not possible. Each pass of the loop is a segment: choose its modes, find how
 * far they can be followed, advance, and apply what has ended them. `trace` receives the segments, or is null. */
static enum trouble tick_with_events(const scene_t* scene, const real* x, segment_t* segment, double h, report_t* report,
                                     trace_t* trace, real* now) {
  long long losses = 0;
  double left = h;
  copy(now, x, NX);
  if (is_inside(scene, now, segment)) return INSIDE;
  segment->trace = trace;
  while (segment->memory->work < scene->work_limit) {
    real after[NX], anchor[2 * NC + 1];
    int event_free;
    record_t* record = segment->record = next_record(scene, trace, now);
    const enum trouble trouble = begin_segment(scene, now, segment, h, &losses, report, anchor);
    if (trouble != NONE) return trouble;
    fix_straight_contacts(scene, now, segment, h);
    const double reach = fmin(left, find_reach(scene, segment, h));
    record_begin(scene, record, segment, now);
    /* Without internal states nothing changes until the end; a drive that has some may still break it loose. */
    if (NX == 2 * NU && is_immobile(scene, now, segment)) {
      clear(now + NU, NU);
      record_end(scene, record, now, left, 1);
      record_step(segment, left);
      return NONE;
    }
    const double length = advance_segment(scene, now, segment, reach, after, &event_free);
    if (length < 0.0) return NUMBERS;
    record_end(scene, record, after, length, event_free);
    find_ended_modes(scene, after, segment, event_free);
    close_contacts(scene, after, segment, anchor);
    if (record)
      for (int i = 0; i < 2 * NU; ++i)
        record->closing_change = fmax(record->closing_change, fabs(after[i] - record->motion_end[i]));
    if (!stop_joints(scene, after, segment)) return NUMBERS;
    stop_at_limits(scene, after);
    copy(now, after, NX);
    if ((event_free && reach == left) || left - length <= 0.0) return NONE;
    left -= length;
  }
  ++report->time_stepped;
  if (trace) trace->time_stepped = 1;
  return step_through(scene, now, segment, left, report);
}
