/* SPDX-License-Identifier: Apache-2.0
 *
 * A smooth segment of a tick, its modes, and the memory of what has been computed in the tick.
 */

#pragma once
#include "contact/friction_cones.h"
#include "modes/geometry.h"
#include "modes/loads.h"
#include "modes/prediction.h"
#include "modes/tick_record.h"
#include "motion/flow.h"
#include "motion/report.h"

#define GAP_ROUNDING (4 * 2.220446049250313e-16) /* rounding of a gap, as a multiple of the lengths that add up to it */
#define SPEED_ROUNDING 1e-13 /* speeds treated as rounding, relative to the fastest joint */

/* State of a contact besides its mode; all numbers, as they lie in an array of them. */
typedef struct {
  real touching;
  real slides;    /* slides already, in the direction ... */
  real direction[2];
  real creeps;    /* treated as at rest although it creeps */
  real ended;     /* end of its last mode: APART, SLIDES, else STICKS ... */
  real slips[2];  /* ... and its next sliding direction */
} contact_t;
#define CONTACT_STATE ((int)(sizeof(contact_t) / sizeof(real)))

/* How the velocity of a sliding contact turns, see sliding_direction.h. */
typedef struct {
  real rate;  /* at which friction turns it towards its limiting direction, and it slows down; 0 if it does not slide */
  real slows; /* rate at which it loses its speed; 0 if it gains */
  real drift; /* speed across its direction at which friction balances the turn */
  real turn;  /* acceleration across its direction */
} turning_t;
#define TURNING ((int)(sizeof(turning_t) / sizeof(real)))

/* What is kept during a tick: the operations of the generated functions; where the contacts are in the last states for which
 * that was computed, such as those at its beginning and at its end; and the last loads, with their state and modes. */
#define STATES 2
typedef struct {
  long long work, states, loaded;
  real* x[STATES];
  geometry_t geometry[STATES];
  real *loads_x, *loads_in;
  loads_t loads;
  geometry_t places_of_guards; /* room for the evaluation of guards, ... */
  loads_t loads_of_guards;
  real* switch_values; /* ... of switches with their sizes */
} memory_t;

/* A smooth segment of a tick: modes of joints and contacts, and command. */
typedef struct {
  modes_t p;
  contact_t* contact;
  turning_t* turning; /* at its beginning, if `turns` is set, which a change of modes clears */
  real* turned;       /* whether the other direction has been tried for a joint that moved the wrong way */
  int turns;
  int yields;      /* whether what holds together has just reached its limits */
  double step; /* length of the steps if the tick is time-stepped, else 0 */
  const real* u;
  memory_t* memory;
  control_t* control;
  const prediction_t* predicted; /* answers that are known beforehand, or null */
  trace_t* trace;   /* receives the segments of the tick, or null ... */
  record_t* record; /* ... and this one, or null */
} segment_t;
#define SEGMENT (P_LENGTH + (CONTACT_STATE + TURNING) * NC + ND)
#define MEMORY (STATES * (2 * NU + PLACES) + NX + MODES + 2 * LOADS + PLACES + 2 * NK)

static memory_t memory_of(const scene_t* scene, real* numbers) {
  memory_t memory;
  memory.work = memory.states = memory.loaded = 0;
  for (int i = 0; i < STATES; ++i) {
    memory.x[i] = numbers;
    memory.geometry[i] = geometry_of(scene, numbers + 2 * NU);
    numbers += 2 * NU + PLACES;
  }
  memory.loads_x = numbers;
  memory.loads_in = memory.loads_x + NX;
  memory.loads = loads_of(scene, memory.loads_in + MODES);
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
  segment.turned = (real*)(segment.turning + NC);
  segment.turns = segment.yields = 0;
  segment.step = 0.0;
  segment.control = 0;
  segment.predicted = 0;
  segment.trace = 0;
  segment.record = 0;
  clear(numbers, SEGMENT);
  for (int k = 0; k < NC; ++k) segment.contact[k].ended = STICKS;
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
  return segment->contact[k].creeps != 0.0 ? scene->friction[k] : scene->holding[k];
}

/* Whether a contact is closed and slides. */
static int is_sliding(const contact_mode_t* mode) { return mode->closed != 0.0 && mode->sticks == 0.0; }
