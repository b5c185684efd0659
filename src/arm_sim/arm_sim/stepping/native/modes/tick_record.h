/* SPDX-License-Identifier: Apache-2.0
 *
 * What is recorded of a tick and its segments, for derivatives.
 */

#pragma once
#include "modes/mode_vector.h"

/* A segment of a tick, for derivatives.
 *
 * before_impact:      state before the impact with which it begins (NX)
 * motion_begin:       state with which its motion begins (NX)
 * motion_end:         state at the end of its motion, before its contacts are closed (NX)
 * p:                  modes of its motion (P_LENGTH)
 * stick_limit:        fraction of its normal force up to which a contact sticks (NC)
 * impact_direction:   of joints in the impact: 0 where they took part in it at their stops (ND)
 * departure_velocity: of joints that rebounded from their stops in the impact, else 0 (NU)
 * rebound:            of contacts: speeds away from their planes after the impact (NC)
 * impulse:            of contacts in the impact (MC)
 * length:             duration of its motion
 * closing_change:     largest change of positions and velocities by closing its contacts afterwards
 * rebound_fraction:   fraction of the full rebound in the impact
 * steps:              number of steps of its motion
 * event_free:         whether no event ended it
 * has_impact:         whether it began with an impact
 */
typedef struct {
  real *before_impact, *motion_begin, *motion_end;
  modes_t p;
  real *stick_limit, *impact_direction, *departure_velocity, *rebound, *impulse;
  real length, closing_change, rebound_fraction;
  long long steps;
  int event_free, has_impact;
} record_t;
#define RECORD (3 * NX + P_LENGTH + NC + ND + NU + NC + MC)
#define CLOSING_ROUNDING 1e-12 /* closing_change of contacts that were closed to rounding */

static record_t record_of(const scene_t* scene, real* numbers) {
  record_t record;
  record.before_impact = numbers;
  record.motion_begin = record.before_impact + NX;
  record.motion_end = record.motion_begin + NX;
  record.p = modes_of(scene, record.motion_end + NX);
  record.stick_limit = record.p.all + P_LENGTH;
  record.impact_direction = record.stick_limit + NC;
  record.departure_velocity = record.impact_direction + ND;
  record.rebound = record.departure_velocity + NU;
  record.impulse = record.rebound + NC;
  record.length = record.closing_change = record.rebound_fraction = 0.0;
  record.steps = record.event_free = record.has_impact = 0;
  clear(numbers, RECORD);
  return record;
}

/* A traced tick.
 *
 * records:       of its segments
 * numbers:       arrays of the records, RECORD numbers for each
 * steps:         lengths of the steps of all segments, one after the other
 * capacity:      records for which there is room
 * step_capacity: steps for which there is room
 * count:         how many segments there were, even if there was room for fewer
 * step_count:    how many steps there were, even if there was room for fewer
 * time_stepped:  whether its end was time-stepped
 */
typedef struct {
  record_t* records;
  double *numbers, *steps;
  long long capacity, step_capacity, count, step_count, time_stepped;
} trace_t;
