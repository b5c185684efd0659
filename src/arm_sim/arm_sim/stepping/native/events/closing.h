/* SPDX-License-Identifier: Apache-2.0
 *
 * Corrections of a state: its projection onto closed contacts and the anchors of sticking ones; joints that stop.
 */

#pragma once
#include "modes/evaluations.h"

#define PROJECTED 1e-9   /* correction to contacts whose square is far below rounding: a second step is unnecessary */
#define SUDDEN_STOP 1e-6 /* speed tolerated of a joint that is found to stop, relative to the fastest joint */

/* Whether a closed contact has a gap or a velocity to be corrected. */
static int is_off(const scene_t* scene, const real* x, const segment_t* segment, const geometry_t* geometry) {
  const double limit = speed_rounding(scene, x) / 10.0;
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t* mode = segment->p.contact + k;
    const real* s = geometry->speed + 3 * k;
    if (mode->closed == 0.0) continue;
    if (fabs(geometry->place[3 * k]) > GAP_ROUNDING * geometry->size[k] || fabs(s[0]) > limit) return 1;
    if (mode->sticks != 0.0 && (fabs(s[1]) > limit || fabs(s[2]) > limit)) return 1;
  }
  return 0;
}

/* Positions and velocities with closed contacts: one step of the projection. */
static void find_closed(const scene_t* scene, const real* x, const segment_t* segment, const real* anchor, real* after) {
  const prediction_t* prediction = segment->predicted;
  if (NC && is_predicted(scene, segment) && prediction->closes && same(x, prediction->after, 2 * NU)
      && same(anchor, prediction->anchor, 2 * NC)) {
    copy(after, prediction->closed, 2 * NU);
    return;
  }
  CALL(scene->contact_close, (x, segment->p.all, anchor), (after));
}

/* Project positions and velocities onto the closed contacts, and onto the anchors of sticking ones. */
static void close_contacts(const scene_t* scene, real* x, const segment_t* segment, const real* anchor) {
  if (!any_closed(scene, segment->p.all)) return;
  real after[2 * NU];
  for (int turn = 0; turn < 2; ++turn) {
    find_closed(scene, x, segment, anchor, after);
    double way = 0.0;
    for (int i = 0; i < NU; ++i) way = fmax(way, fabs(after[i] - x[i]));
    for (int i = 0; i < 2 * NU; ++i) x[i] = after[i];
    if (way < PROJECTED) break;
  }
}

/* Bring all touching points to rest where closing some contacts has moved others into their planes.
 *
 * The impact that stopped the former has opened the latter, but below the threshold: a body that rocks so little is at rest.
 */
static void rest_touching(const scene_t* scene, real* x, const segment_t* segment, const real* anchor) {
  if (NC < 2) return;
  const double rounding = speed_rounding(scene, x);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL_SEGMENT(resting, segment);
  int any = 0;
  find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) {
    if (segment->contact[k].touching == 0.0) continue;
    any |= segment->p.contact[k].closed == 0.0 && geometry.speed[3 * k] < -rounding;
    resting.p.contact[k].closed = 1.0;
  }
  if (any) close_contacts(scene, x, &resting, anchor);
}

/* Position of each point in its plane's tangents. */
static void find_anchors(const scene_t* scene, const geometry_t* geometry, real* anchor) {
  for (int i = 0; i < 2 * NC; ++i) anchor[i] = geometry->place[3 * (i / 2) + 1 + i % 2];
}

/* Set joints that have just reached zero speed at rest: 0 if one was still fast, since the motion was not continuous. */
static int stop_joints(const scene_t* scene, real* x, const segment_t* segment) {
  const double fastest = max_abs(x + NU, NU);
  for (int i = 0; i < ND; ++i)
    if (may_stick(scene, i) && x[NU + i] * segment->p.direction[i] <= 0.0) {
      if (fabs(x[NU + i]) > SUDDEN_STOP * (1.0 + fastest)) return 0;
      x[NU + i] = 0.0;
    }
  return 1;
}

/* Move joints that are beyond a rigid stop by rounding to the stop. */
static void stop_at_limits(const scene_t* scene, real* x) {
  for (int i = 0; scene->rigid && i < NU; ++i) x[i] = fmin(fmax(x[i], scene->rigid_stop[0][i]), scene->rigid_stop[1][i]);
}
