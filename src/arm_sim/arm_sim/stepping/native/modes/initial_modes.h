/* SPDX-License-Identifier: Apache-2.0
 *
 * The modes with which pivoting begins: what touches and presses, and what moves slides.
 */

#pragma once
#include "modes/held_sets.h"
#include "modes/rebounds.h"

#define DRIFT_ROUNDING 1e-10 /* acceleration of a constraint that is rounding, relative to the square of the speed */

/* On both sides of all joints, `push`: torques of compliant stops; `overlap`: the lesser of torque and penetration, positive
 * where a joint is in contact with its stop. */
static void find_pressures(const scene_t* scene, const real* x, double overlap[2][NU], double push[2][NU]) {
  real pressure[2 * NU];
  CALL(scene->pressures, (x), (pressure));
  for (int i = 0; i < NQ; ++i)
    for (int side = 0; side < 2; ++side) {
      push[side][i] = pressure[NU * side + i];
      overlap[side][i] = fmin(push[side][i], side ? x[i] - scene->soft_stop[1][i] : scene->soft_stop[0][i] - x[i]);
    }
}

/* Joints in contact with compliant stops: those that press against them, or are about to. */
static void find_pressed(const scene_t* scene, const real* x, segment_t* segment) {
  double overlap[2][NU], push[2][NU];
  if (!NQ) return;
  find_pressures(scene, x, overlap, push);
  for (int i = 0; i < NQ; ++i) {
    const real speed = x[NU + i];
    const int lower = overlap[0][i] > 0.0 || (overlap[0][i] == 0.0 && speed < 0.0);
    const int upper = overlap[1][i] > 0.0 || (overlap[1][i] == 0.0 && speed > 0.0);
    segment->p.pressed[i] = upper - lower;
  }
}

/* Contacts whose gap is closed to rounding. */
static void find_closed_gaps(const scene_t* scene, segment_t* segment, const geometry_t* geometry) {
  for (int k = 0; k < NC; ++k)
    segment->contact[k].is_touching = geometry->place[3 * k] <= 4 * GAP_ROUNDING * geometry->size[k];
}

/* Contacts whose gap is closed to rounding and does not open. */
static void find_touching(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  contact_t* contact = segment->contact;
  double least_rebound[NC + 1];
  int opens = 0;
  find_closed_gaps(scene, segment, geometry);
  for (int k = 0; k < NC; ++k) opens |= contact[k].is_touching != 0.0 && geometry->speed[3 * k] > speed_rounding(scene, x);
  if (!opens) return;
  find_rounding_rebounds(scene, x, segment, geometry, least_rebound);
  for (int k = 0; k < NC; ++k)
    contact[k].is_touching = contact[k].is_touching != 0.0 && geometry->speed[3 * k] <= least_rebound[k];
}

/* The end of a contact's last mode determines the initial guess. */
static void guess_from_next_state(contact_mode_t* mode, const contact_t* contact) {
  if (contact->is_touching == 0.0 || contact->next_state == STICKS) return;
  if (contact->next_state == APART) mode->closed = 0.0;
  if (contact->next_state == SLIDES && contact->was_sliding != 0.0) return;
  mode->sticks = 0.0;
  mode->along[0] = contact->next_state == SLIDES ? contact->slip_direction[0] : 1.0;
  mode->along[1] = contact->next_state == SLIDES ? contact->slip_direction[1] : 0.0;
}

/* Initial guess of a contact: one that touches is closed, and sticks if it is at rest. */
static void guess_contact(const scene_t* scene, int k, segment_t* segment, const geometry_t* geometry) {
  contact_t* contact = segment->contact + k;
  const real* s = geometry->speed + 3 * k + 1;
  const double size = hypot(s[0], s[1]);
  const int still = scene->static_friction[k] > 0.0 && (size <= scene->slowest || contact->is_creeping != 0.0),
            has_direction = scene->friction[k] > 0.0 && !still;
  contact->was_sliding = !still;
  contact->sliding_direction[0] = has_direction ? s[0] / size : 1.0;
  contact->sliding_direction[1] = has_direction ? s[1] / size : 0.0;
  contact_mode_t* mode = segment->p.contact + k;
  mode->closed = contact->is_touching;
  mode->sticks = contact->is_touching != 0.0 && still;
  for (int i = 0; i < 2; ++i) mode->along[i] = contact->sliding_direction[i];
  mode->fixed = still;
  guess_from_next_state(mode, contact);
}

/* Initial guess: moving joints slide and those at rest stick; touching contacts are closed and those at rest stick. */
static void guess_from_velocities(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  for (int i = 0; i < ND; ++i) {
    segment->p.direction[i] = rests(scene, x, i) ? 0.0 : may_stick(scene, i) ? sign_of(x[NU + i]) : 1.0;
    segment->has_tried_reverse[i] = 0;
  }
  find_pressed(scene, x, segment);
  real value[NK + 1], size[NK + 1];
  find_switches(scene, x, segment, value, size);
  for (int k = 0; k < NK; ++k) segment->p.switches[k] = value[k] >= 0.0;
  find_touching(scene, x, segment, geometry);
  for (int k = 0; k < NC; ++k) guess_contact(scene, k, segment, geometry);
}

/* Joints at rest that loops in motion take along: with all of them held, the constraints could not be satisfied. */
static int find_carried(const scene_t* scene, const real* x, const segment_t* segment, int* carried) {
  LOCAL(statics_t, balance, statics_of, STATICS);
  double T[NM * (NU + 1) + 1];
  int basic[NM + 1], column[NU], moving = 0, count = 0, any = 0;
  const double fastest = max_abs(x + NU, NU);
  for (int i = 0; i < NU; ++i) {
    carried[i] = 0;
    moving += !rests(scene, x, i);
  }
  if (moving == NU) return 0;
  find_statics(scene, x, segment, &balance);
  for (int i = 0; i < NU; ++i) column[i] = rests(scene, x, i) ? moving + i - count : count++;
  for (int k = 0; k < NM; ++k) {
    const double largest = max_abs(balance.push + NU * k, NU), size = largest > 0.0 ? largest : 1.0;
    for (int i = 0; i < NU; ++i) T[(NU + 1) * k + column[i]] = balance.push[i + NU * k] / size;
    T[(NU + 1) * k + NU] = balance.drift[k] / size;
    basic[k] = -1;
  }
  eliminate(NM, NU + 1, T, 0, moving, basic);
  for (int k = 0; k < NM; ++k) {
    const double* row = T + (NU + 1) * k;
    if (basic[k] >= 0 || fabs(row[NU]) <= DRIFT_ROUNDING * fastest * fastest) continue;
    for (int i = 0; i < NU; ++i) carried[i] |= rests(scene, x, i) && fabs(row[column[i]]) > DRIFT_ROUNDING;
  }
  for (int i = 0; i < NU; ++i) any |= carried[i];
  return any;
}

/* In a moving loop, a joint that passes through rest may be driven by the loop: begin with its direction. */
static void guess_turning(const scene_t* scene, const real* x, segment_t* segment) {
  real slope[NX];
  int carried[NU];
  if (!ND || !find_carried(scene, x, segment, carried)) return;
  for (int i = 0; i < ND; ++i)
    if (carried[i]) segment->p.direction[i] = 1.0;
  find_slope(scene, x, segment, slope);
  for (int i = 0; i < ND; ++i) {
    const double direction = sign_of(slope[NU + i]);
    if (carried[i]) segment->p.direction[i] = direction * at_stop(scene, x, i) > 0.0 ? 0.0 : direction;
  }
}

/* The modes with which pivoting begins at x. */
static void guess_modes(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  guess_from_velocities(scene, x, segment, geometry);
  if (scene->constrained && max_abs(x + NU, NU) > 0.0) guess_turning(scene, x, segment);
}
