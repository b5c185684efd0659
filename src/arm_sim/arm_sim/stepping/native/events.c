/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks with events: smooth segments between touch-downs, lift-offs, slips, stops and break-aways.
 *
 * Between two such instants each joint slides one way or sticks, and each contact is apart, slides or sticks; the equation
 * is as smooth as without friction and contact, so the method keeps its order, and the instants are located to rounding
 * (Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, 1996). A joint that sticks has acceleration zero, not a
 * small one: it stays where it is, to the bit. Joints alone are the case of no contacts.
 *
 * Before this file: impact.c, segments.c; DEEP (how far inside its plane a point may be and still be taken for touching).
 */

#define EVENTS
#define MOST_EVENTS (NC ? 5000 : 50 * NU) /* a tick with more is not a motion any more */
#define MOST_REBOUNDS 500 /* impacts in one tick after which its contacts do not rebound any more */

static int is_inside(const real* x) {
  geometry_t geometry;
  int inside = 0;
  find_geometry(x, &geometry);
  for (int k = 0; k < NC; ++k) inside |= geometry.place[3 * k] < -DEEP;
  return inside;
}

/* Choose the modes at x, with impacts first, and set x right for them; `anchor` receives where points stick. */
static enum trouble begin_segment(real* x, segment_t* segment, double tick, long long impacts, report_t* report,
                                  real* anchor) {
  geometry_t geometry;
  const double lost = impact(x, segment, impacts < MOST_REBOUNDS, &geometry);
  if (stop_rounding(x)) find_geometry(x, &geometry);
  for (int k = 0; k < NC; ++k) segment->contact[k].slow = 0;
  if (lost < 0.0 || !settle(x, segment, &geometry)) return UNDETERMINED;
  if (find_slow(x, segment, tick)) {
    if (!settle(x, segment, &geometry)) return UNDETERMINED;
    align(x, segment);
    find_geometry(x, &geometry);
  }
  report->impact_loss += lost;
  report->impacts += lost > 0.0;
  find_anchors(&geometry, anchor);
  if (is_off(x, segment, &geometry)) close_contacts(x, segment, anchor);
  return NONE;
}

static enum trouble tick_with_events(const real* x, segment_t* segment, double h, report_t* report, real* now) {
  const long long impacts_before = report->impacts;
  double left = h;
  for (int i = 0; i < NX; ++i) now[i] = x[i];
  if (is_inside(now)) return INSIDE;
  for (int k = 0; k < NC; ++k) segment->contact[k].ended = STICKS;
  for (long long event = 0; event < MOST_EVENTS; ++event) {
    real after[NX], anchor[2 * NC];
    int calm;
    const long long impacts = report->impacts - impacts_before;
    const enum trouble trouble = begin_segment(now, segment, h, impacts, report, anchor);
    if (trouble != NONE) return trouble;
    if (NX == 2 * NU && is_held(now, segment)) { /* with states of its own, a drive may still break it loose */
      for (int i = NU; i < NX; ++i) now[i] = 0.0;
      return NONE;
    }
    const double reach = fmin(left, find_reach(now, segment, h)), length = advance(now, segment, reach, after, &calm);
    if (length < 0.0) return NUMBERS;
    find_ended(after, segment, calm);
    close_contacts(after, segment, anchor);
    if (!stop_joints(after, segment)) return NUMBERS;
    for (int i = 0; i < NX; ++i) now[i] = after[i];
    if ((calm && reach == left) || left - length <= 0.0) return NONE;
    left -= length;
  }
  return EVENTS_WITHOUT_END;
}

static int tick(const real* x, const real* u, const real* p, double h, control_t* control, report_t* report, real* after) {
  segment_t segment = {.u = u, .control = control};
  for (int i = 0; i < NP; ++i) segment.p.tunable[i] = p[i];
  report->trouble = tick_with_events(x, &segment, h, report, after);
  return report->trouble == NONE;
}
