/* SPDX-License-Identifier: Apache-2.0
 *
 * A smooth segment of a tick, its modes, and what is kept of the evaluations in it.
 */

#pragma once
#include "contact/friction_cones.h"
#include "modes/loads.h"
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
  real slow;      /* treated as at rest although it creeps */
  real ended;     /* end of its last mode: APART, SLIDES, else STICKS ... */
  real slips[2];  /* ... and its next sliding direction */
} contact_t;

/* How the velocity of a sliding contact turns. */
typedef struct {
  real rate;  /* at which friction turns it towards its limiting direction, and slows it down; 0 if it does not slide */
  real slows; /* rate at which it loses its speed; 0 if it gains */
  real drift; /* speed across that direction, which the rate reduces */
  real turn;  /* acceleration across its own */
} turning_t;

/* Holding torques of sticking joints, relative to their level; forces, accelerations and grips of contacts; x'. */
typedef struct {
  real *load, *force, *rate, *grip, *slope;
} loads_t;

static loads_t loads_of(const scene_t* scene, real* numbers) {
  loads_t loads = {numbers, numbers + NU, numbers + NU + MC, numbers + NU + 2 * MC, numbers + NU + 7 * NC};
  return loads;
}

/* Mobility of the contacts, of joints by contacts, and accelerations of contacts without forces. */
typedef struct {
  real *W, *B, *free;
} inertia_t;

static inertia_t inertia_of(const scene_t* scene, real* numbers) {
  inertia_t inertia = {numbers, numbers + MC * MC, numbers + MC * MC + NU * MC};
  return inertia;
}

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
#define SEGMENT (P_LENGTH + 12 * NC + ND)
#define MEMORY (STATES * (2 * NU + PLACES) + NX + MODES + 2 * LOADS + PLACES + 2 * NK)

/* Rigid stops: -1 and 1 for a joint at its lower or upper one, else 0. */
static int at_stop(const scene_t* scene, const real* x, int joint) {
  if (!scene->rigid) return 0;
  return x[joint] <= scene->rigid_stop[0][joint] ? -1 : x[joint] >= scene->rigid_stop[1][joint];
}

static memory_t memory_of(const scene_t* scene, real* numbers) {
  memory_t memory;
  memory.work = memory.states = memory.loaded = 0;
  for (int i = 0; i < STATES; ++i) {
    memory.x[i] = numbers;
    memory.geometry[i] = geometry_of(scene, numbers + 2 * NU);
    numbers += 2 * NU + PLACES;
  }
  memory.loads_x = numbers;
  memory.loads_in = numbers + NX;
  numbers += NX + MODES;
  memory.loads = loads_of(scene, numbers);
  memory.loads_of_guards = loads_of(scene, numbers + LOADS);
  memory.places_of_guards = geometry_of(scene, numbers + 2 * LOADS);
  memory.switch_values = numbers + 2 * LOADS + PLACES;
  return memory;
}

static segment_t segment_of(const scene_t* scene, real* numbers) {
  real *contacts = numbers + P_LENGTH, *turnings = contacts + 8 * NC, *turned = turnings + 4 * NC;
  segment_t segment = {
      modes_of(scene, numbers), (contact_t*)contacts, (turning_t*)turnings, turned, 0, 0, 0.0, 0, 0, 0, 0, 0, 0};
  clear(numbers, SEGMENT);
  for (int k = 0; k < NC; ++k) segment.contact[k].ended = STICKS;
  return segment;
}

/* Declare the memory and the first segment of a tick, of which nothing is known yet but the command. */
#define LOCAL_TICK(segment, command) \
  LOCAL(memory_t, memory, memory_of, MEMORY); \
  LOCAL(segment_t, segment, segment_of, SEGMENT); \
  segment.u = command; \
  segment.memory = &memory

/* Whether answers are known for the modes of a segment. */
static int is_predicted(const scene_t* scene, const segment_t* segment) {
  return segment->predicted && same(segment->p.tunable, segment->predicted->p, P_LENGTH);
}

static void keep_geometry(const scene_t* scene, const real* x, memory_t* memory, const real* geometry) {
  const long long place = memory->states++ % STATES;
  copy(memory->x[place], x, 2 * NU);
  copy(memory->geometry[place].place, geometry, PLACES);
}

static void find_geometry(const scene_t* scene, const real* x, const segment_t* segment, geometry_t* geometry) {
  const prediction_t* prediction = segment->predicted;
  if (!NC) return;
  const double* answer = 0;
  if (prediction && same(x, prediction->x, 2 * NU)) answer = prediction->geometry;
  else if (prediction && same(x, prediction->after, 2 * NU)) answer = prediction->geometry_after;
  memory_t* memory = segment->memory;
  for (int i = 0; !answer && i < STATES && i < memory->states; ++i)
    if (same(x, memory->x[i], 2 * NU)) answer = memory->geometry[i].place;
  if (answer) {
    copy(geometry->place, answer, PLACES);
    return;
  }
  find_places(scene, x, geometry->place);
  keep_geometry(scene, x, memory, geometry->place);
}

/* The numbers of the loads at x if they are known; else null. */
static const real* known_loads(const scene_t* scene, const real* x, const segment_t* segment) {
  const prediction_t* prediction = segment->predicted;
  const memory_t* memory = segment->memory;
  if (is_predicted(scene, segment) && prediction->rests && same(x, prediction->x, NX)) return prediction->loads;
  if (!memory->loaded || !same(x, memory->loads_x, NX)) return 0;
  return same(segment->p.direction, memory->loads_in, MODES) ? memory->loads.load : 0;
}

static void keep_loads(const scene_t* scene, const real* x, const real* modes, memory_t* memory, const loads_t* loads) {
  memory->loaded = 1;
  copy(memory->loads.load, loads->load, LOADS);
  copy(memory->loads_x, x, NX);
  copy(memory->loads_in, modes, MODES);
}

static void find_loads(const scene_t* scene, const real* x, const segment_t* segment, loads_t* loads) {
  const real* known = known_loads(scene, x, segment);
  memory_t* memory = segment->memory;
  if (known) {
    copy(loads->load, known, LOADS);
    return;
  }
  memory->work += scene->loads_cost;
  loads_at(scene, x, segment->u, segment->p.tunable, loads->load);
  keep_loads(scene, x, segment->p.direction, memory, loads);
}

static void find_inertia(const scene_t* scene, const real* x, const segment_t* segment, inertia_t* inertia) {
  const prediction_t* prediction = segment->predicted;
  segment->memory->work += scene->inertia_cost;
  if (!NC) return;
  if (is_predicted(scene, segment) && prediction->slides && same(x, prediction->x, NX)) {
    copy(inertia->W, prediction->inertia, INERTIA);
    return;
  }
  CALL(scene->contact_inertia, (x, segment->u, segment->p.tunable), (inertia->W, inertia->B, inertia->free));
}

static void find_slope(const scene_t* scene, const real* x, const segment_t* segment, real* slope) {
  const real* loads = known_loads(scene, x, segment);
  const real* answer = loads ? loads + LOADS - NX : 0;
  /* Steps in motion are of other functions. */
  if (!scene->moving && is_predicted(scene, segment) && same(x, segment->predicted->x, NX))
    answer = segment->predicted->inside;
  if (answer) {
    copy(slope, answer, NX);
    return;
  }
  segment->memory->work += scene->slope_cost;
  slope_at(scene, x, segment->u, segment->p.tunable, slope);
}

/* Switching functions of drives and cords, positive where a comparison holds, and the magnitude of their terms. */
static void find_switches(const scene_t* scene, const real* x, const segment_t* segment, real* value, real* size) {
  if (!NK) return;
  CALL(scene->switches, (x, segment->u, segment->p.tunable), (value, size));
}

static double sign_of(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }

/* Speed of a contact treated as rounding. */
static double speed_rounding(const scene_t* scene, const real* x) { return SPEED_ROUNDING * (1.0 + largest_of(x + NU, NU)); }

/* Whether dry friction may hold a joint; whether a joint is at rest and may be held by friction or a stop. */
static int may_stick(const scene_t* scene, int joint) { return ND && scene->static_level[joint] > 0.0; }
static int rests(const scene_t* scene, const real* x, int joint) {
  return x[NU + joint] == 0.0 && (may_stick(scene, joint) || at_stop(scene, x, joint));
}

/* Fraction of its normal force up to which a contact sticks: one that creeps has broken away already. */
static double stick_limit(const scene_t* scene, const segment_t* segment, int k) {
  return segment->contact[k].slow != 0.0 ? scene->friction[k] : scene->holding[k];
}

static int is_sliding(const contact_mode_t* mode) { return mode->closed != 0.0 && mode->sticks == 0.0; }
