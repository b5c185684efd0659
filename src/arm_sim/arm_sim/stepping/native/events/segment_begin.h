/* SPDX-License-Identifier: Apache-2.0
 *
 * Beginning of a smooth segment: impacts, modes, and the corrections that these ask for.
 */

#pragma once
#include "events/closing.h"
#include "events/impact.h"
#include "events/sliding_direction.h"
#include "guards/guard.h"

#define CORRECTIONS 10    /* of penetrations, or of contacts that set joints in motion */
#define LOSS_LIMIT 500 /* impacts with loss in one tick after which contacts no longer rebound */

/* Whether a contact point is inside its plane, farther than by rounding. */
static int is_inside(const scene_t* scene, const real* x, const segment_t* segment) {
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  int inside = 0;
  find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) inside |= geometry.place[3 * k] < -scene->penetration_limit;
  return inside;
}

/* Whether a joint moves against its sliding direction, as contacts that were brought to rest may cause. */
static int turns_back(const scene_t* scene, const real* x, const segment_t* segment) {
  const double rounding = turning_rounding(scene, x);
  int any = 0;
  for (int i = 0; i < ND; ++i) any |= may_stick(scene, i) && x[NU + i] * segment->p.direction[i] < -rounding;
  return any;
}

/* Set joints with dry friction or at stops at rest if the arm's constraints hold them up to rounding: 1 if any moved. */
static int stop_rounding(const scene_t* scene, real* x) {
  const double limit = speed_rounding(scene, x);
  int any = 0;
  for (int i = 0; i < ND; ++i) {
    const int side = at_stop(scene, x, i), kept = side ? side * x[NU + i] > 0.0 || scene->constrained + NC > 0
                                                       : may_stick(scene, i) && scene->constrained + NC > 0;
    if (!kept || x[NU + i] == 0.0 || fabs(x[NU + i]) > limit) continue;
    x[NU + i] = 0.0;
    any = 1;
  }
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
  const double loss = apply_impact(scene, x, segment, *losses < LOSS_LIMIT, &geometry);
  for (int i = 0; i < NU; ++i) hit |= x[NU + i] != before[i]; /* an elastic impact loses no energy */
  if (stop_rounding(scene, x)) find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) segment->contact[k].is_creeping = 0;
  if (loss < 0.0 || !solve_modes(scene, x, segment, &geometry)) return UNDETERMINED;
  if (mark_creeping_contacts(scene, x, segment, tick)) {
    if (!solve_modes(scene, x, segment, &geometry)) return UNDETERMINED;
    stop_reversed_contacts(scene, x, segment);
    find_geometry(scene, x, segment, &geometry);
  }
  report->impact_loss += loss;
  report->impacts += hit;
  *losses += loss > 0.0;
  find_anchors(scene, &geometry, anchor);
  for (int correction = 0; correction < CORRECTIONS; ++correction) {
    if (violates_contacts(scene, x, segment, &geometry)) {
      close_contacts(scene, x, segment, anchor);
      rest_touching(scene, x, segment, anchor);
    }
    if (!turns_back(scene, x, segment)) break;
    find_geometry(scene, x, segment, &geometry);
    if (!solve_modes(scene, x, segment, &geometry)) return UNDETERMINED;
  }
  return NONE;
}
