/* SPDX-License-Identifier: Apache-2.0
 *
 * Projection of a state onto closed contacts and the anchors of sticking ones.
 */

#pragma once
#include "modes/evaluations.h"

#define CLOSING_STEPS 2        /* of the projection; Python: CLOSING_STEPS of rest_projection.py */
#define CLOSING_TOLERANCE 1e-9 /* change of positions whose square is far below rounding: a further step is unnecessary */

/* Whether a closed contact has a gap or a velocity to be corrected. */
static int violates_contacts(const scene_t* scene, const real* x, const segment_t* segment, const geometry_t* geometry) {
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
  if (NC && is_predicted(scene, segment) && prediction->needs_closing && same(x, prediction->after, 2 * NU)
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
  for (int step = 0; step < CLOSING_STEPS; ++step) {
    find_closed(scene, x, segment, anchor, after);
    double change = 0.0;
    for (int i = 0; i < NU; ++i) change = fmax(change, fabs(after[i] - x[i]));
    for (int i = 0; i < 2 * NU; ++i) x[i] = after[i];
    if (change < CLOSING_TOLERANCE) break;
  }
}

/* Bring all touching points to rest where closing some contacts has moved others into their planes.
 *
 * The impact that stopped some has opened the others, but below the threshold: a body that rocks so little is at rest.
 */
static void rest_touching(const scene_t* scene, real* x, const segment_t* segment, const real* anchor) {
  if (NC < 2) return;
  const double rounding = speed_rounding(scene, x);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL_SEGMENT(resting, segment);
  int any = 0;
  find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) {
    if (segment->contact[k].is_touching == 0.0) continue;
    any |= segment->p.contact[k].closed == 0.0 && geometry.speed[3 * k] < -rounding;
    resting.p.contact[k].closed = 1.0;
  }
  if (any) close_contacts(scene, x, &resting, anchor);
}

/* Position of each point in its plane's tangents. */
static void find_anchors(const scene_t* scene, const geometry_t* geometry, real* anchor) {
  for (int i = 0; i < 2 * NC; ++i) anchor[i] = geometry->place[3 * (i / 2) + 1 + i % 2];
}
