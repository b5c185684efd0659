/* SPDX-License-Identifier: Apache-2.0
 *
 * A smooth segment of a tick, its modes, and the memory of what has been computed in the tick.
 */

#pragma once
#include "contact/several_contacts.h"
#include "modes/geometry.h"
#include "modes/loads.h"
#include "modes/prediction.h"
#include "modes/tick_record.h"
#include "motion/flow.h"
#include "motion/report.h"

#include <float.h>

#define GAP_ROUNDING (4 * DBL_EPSILON) /* rounding of a gap, as a multiple of the lengths that add up to it */
#define SPEED_ROUNDING 1e-13 /* speeds treated as rounding, relative to the fastest joint */

/* State of a contact besides its mode; all numbers, as they lie in an array of them.
 *
 * is_touching:       whether its gap is closed to rounding and does not open
 * was_sliding:       whether it slides already
 * sliding_direction: of a contact that slides already, in the two tangents
 * is_creeping:       whether it is treated as at rest although it creeps
 * next_state:        after the end of its last mode: APART or SLIDES; STICKS if that mode has not ended
 * slip_direction:    in which it slides after the end of its last mode
 */
typedef struct {
  real is_touching, was_sliding, sliding_direction[2], is_creeping, next_state, slip_direction[2];
} contact_t;
#define CONTACT_STATE ((int)(sizeof(contact_t) / sizeof(real)))

/* How the velocity of a sliding contact turns, see sliding_direction.h.
 *
 * rate:                 of turning towards its limiting direction and of slowing down; 0 if it does not slide
 * deceleration_rate:    at which it loses its speed; 0 if it gains
 * drift:                speed across its direction at which friction balances the lateral acceleration
 * lateral_acceleration: across its direction, by all but friction
 */
typedef struct {
  real rate, deceleration_rate, drift, lateral_acceleration;
} turning_t;
#define TURNING ((int)(sizeof(turning_t) / sizeof(real)))

#define STATES 2 /* for which places of contacts are kept, such as those at the beginning and at the end of a tick */

/* What is kept during a tick.
 *
 * work:             operations of the generated functions
 * states:           states for which places of contacts were kept, also those that are overwritten
 * has_loads:        whether loads are kept
 * x, geometry:      states, and the places of contacts in them
 * loads:            the last loads
 * loads_x:          state of the last loads
 * loads_modes:      modes of the last loads
 * places_of_guards: room for the evaluation of guards, as the following
 * loads_of_guards:  room for loads
 * switch_values:    room for switches with their sizes
 */
typedef struct {
  long long work, states, has_loads;
  real *x[STATES], *loads_x, *loads_modes, *switch_values;
  geometry_t geometry[STATES], places_of_guards;
  loads_t loads, loads_of_guards;
} memory_t;

/* A smooth segment of a tick.
 *
 * p:                 modes of joints and contacts, and tunable numbers
 * contact:           state of each contact besides its mode
 * turning:           of each contact at the beginning of the segment
 * has_tried_reverse: of joints that moved the wrong way: whether the other direction has been tried
 * has_turning:       whether `turning` is known: a change of modes clears it
 * is_yielding:       whether what holds together has just reached its limits
 * time_step:         length of the steps if the tick is time-stepped, else 0
 * u:                 command that acts
 * memory:            of the tick
 * control:           error control, or null
 * predicted:         answers that are known beforehand, or null
 * trace:             receives the segments of the tick, or null
 * record:            receives this segment, or null
 */
typedef struct {
  modes_t p;
  contact_t* contact;
  turning_t* turning;
  real* has_tried_reverse;
  int has_turning, is_yielding;
  double time_step;
  const real* u;
  memory_t* memory;
  control_t* control;
  const prediction_t* predicted;
  trace_t* trace;
  record_t* record;
} segment_t;
#define SEGMENT (P_LENGTH + (CONTACT_STATE + TURNING) * NC + ND)
#define MEMORY (STATES * (2 * NU + PLACES) + NX + MODES + 2 * LOADS + PLACES + 2 * NK)

static memory_t memory_of(const scene_t* scene, real* numbers) {
  memory_t memory;
  memory.work = memory.states = memory.has_loads = 0;
  for (int i = 0; i < STATES; ++i) {
    memory.x[i] = numbers;
    memory.geometry[i] = geometry_of(scene, numbers + 2 * NU);
    numbers += 2 * NU + PLACES;
  }
  memory.loads_x = numbers;
  memory.loads_modes = memory.loads_x + NX;
  memory.loads = loads_of(scene, memory.loads_modes + MODES);
  memory.loads_of_guards = loads_of(scene, memory.loads.all + LOADS);
  memory.places_of_guards = geometry_of(scene, memory.loads_of_guards.all + LOADS);
  memory.switch_values = memory.places_of_guards.all + PLACES;
  return memory;
}

/* A segment of which nothing is known; command and memory are not set. */
static segment_t segment_of(const scene_t* scene, real* numbers) {
  segment_t segment;
  segment.p = modes_of(scene, numbers);
  segment.contact = (contact_t*)(numbers + P_LENGTH);
  segment.turning = (turning_t*)(segment.contact + NC);
  segment.has_tried_reverse = (real*)(segment.turning + NC);
  segment.has_turning = segment.is_yielding = 0;
  segment.time_step = 0.0;
  segment.control = 0;
  segment.predicted = 0;
  segment.trace = 0;
  segment.record = 0;
  clear(numbers, SEGMENT);
  for (int k = 0; k < NC; ++k) segment.contact[k].next_state = STICKS;
  return segment;
}

/* Declare the memory and the first segment of a tick, of which nothing is known yet but the command and, of `parameters`,
 * the first `count` numbers of p. */
#define LOCAL_TICK(segment, command, parameters, count) \
  LOCAL(memory_t, segment##_memory, memory_of, MEMORY); \
  LOCAL(segment_t, segment, segment_of, SEGMENT); \
  segment.u = command; \
  segment.memory = &segment##_memory; \
  copy(segment.p.all, parameters, count)

/* Declare a segment with modes of its own, which begin as those of another. */
#define LOCAL_SEGMENT(name, like) \
  LOCAL_MODES(name##_modes, (like)->p); \
  segment_t name = *(like); \
  name.p = name##_modes

/* Rigid stops: -1 and 1 for a joint at its lower or upper one, else 0. */
static int at_stop(const scene_t* scene, const real* x, int joint) {
  if (!scene->rigid) return 0;
  return x[joint] <= scene->rigid_stop[0][joint] ? -1 : x[joint] >= scene->rigid_stop[1][joint];
}

static double sign_of(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }

/* Speed of a contact treated as rounding. */
static double speed_rounding(const scene_t* scene, const real* x) { return SPEED_ROUNDING * (1.0 + max_abs(x + NU, NU)); }

/* Whether dry friction may hold a joint; whether a joint is at rest and may be held by friction or a stop. */
static int may_stick(const scene_t* scene, int joint) { return ND && scene->static_level[joint] > 0.0; }
static int rests(const scene_t* scene, const real* x, int joint) {
  return x[NU + joint] == 0.0 && (may_stick(scene, joint) || at_stop(scene, x, joint));
}

/* Fraction of its normal force up to which a contact sticks: one that creeps has broken away already. */
static double stick_limit(const scene_t* scene, const segment_t* segment, int k) {
  return segment->contact[k].is_creeping != 0.0 ? scene->friction[k] : scene->static_friction[k];
}

/* Whether a contact is closed and slides. */
static int is_sliding(const contact_mode_t* mode) { return mode->closed != 0.0 && mode->sticks == 0.0; }
