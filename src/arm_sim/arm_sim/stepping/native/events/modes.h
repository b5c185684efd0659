/* SPDX-License-Identifier: Apache-2.0
 *
 * Selection of the modes of joints with dry friction, joints at stops, and contacts.
 *
 * A joint at rest sticks while its holding torque is within the static level; otherwise it slides in the direction of the
 * torque on it (Glocker, Set-Valued Force Laws, 2001). A joint at rest at a rigid stop is also held, by a reaction that only
 * pushes. A contact touches where its gap is zero to rounding. Which of them stick, slide, transmit forces or separate is a
 * complementarity problem in the metric of M, solved by pivoting: the entry with the largest violation changes its mode
 * until there is none. If that cycles, the first violation is chosen for joints alone, a rule that cannot cycle (Murty,
 * Linear Complementarity, Linear and Nonlinear Programming, 1988, section 4.1), and contacts are solved together by friction_cones.h.
 *
 * Where statics does not determine the reactions of what is held, the parts hold together: see indeterminate.h. A set that does not
 * hold is released in the motion in which it gives way, and pivoting goes on from there.
 */

#pragma once
#include "motion/flow.h"
#include "events/loads.h"
#include "events/trace.h"
#include "motion/report.h"
#include "contact/friction_cones.h"
#include "contact/indeterminate.h"
#include "events/event_location.h"

#define GAP_ROUNDING (4 * 2.220446049250313e-16) /* rounding of a gap, as a multiple of the lengths that add up to it ... */
#define REBOUND_ROUNDING (64 * 2.220446049250313e-16)         /* ... and the threshold of an opening gap */
#define SPEED_ROUNDING 1e-13 /* speeds treated as rounding, relative to the fastest joint */
#define LEAST_REBOUND 1e-9   /* speed of a rebound that is treated as rest */
#define CERTAIN_REBOUND 1e-4     /* speed above which a rebound is certainly not a hop within rounding */
#define SLACK 1e-9           /* tolerated acceleration in the wrong direction, relative to the largest */
#define EDGE 1e-9            /* relative distance from the friction cone within which a force is on its boundary */
#define CARRYING 1e-10       /* acceleration of a constraint that is rounding, relative to the square of the speed */
#define LEAST_SHARE 1e-6     /* share of a part in the motion of its set that is rounding, ... */
#define OPENS 1e-3           /* ... and part of a contact's that is sliding if it does not only open */
#define MOST_SETS 729        /* sets of modes of joints that are tried as a last resort */
#define NEARER 1e-5          /* step of the iteration to forces of least norm, and the number of steps */
#define NEARER_TURNS 6
#define PIVOTS (NC ? 40 * (NC + NU) : 3 * NU + (1 << (NU < 12 ? NU : 12)))
#define WORST_FIRST (NC ? PIVOTS : 3 * NU) /* pivots before the first violation is chosen */

/* State of a contact besides its mode; all numbers, as they lie in an array of them. */
typedef struct {
  real touching;
  real slides;    /* slides already, in the direction ... */
  real given[2];
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

/* Contact points in their planes' axes. */
typedef struct {
  real *place, *speed, *size;
} geometry_t;

static geometry_t geometry_of(const scene_t* scene, real* numbers) {
  geometry_t geometry = {numbers, numbers + MC, numbers + 2 * MC};
  return geometry;
}

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

/* A smooth segment of a tick: command, and modes of joints and contacts. */
typedef struct {
  const real* u;
  control_t* control;
  modes_t p;
  contact_t* contact;
  turning_t* turning; /* at its beginning, ... */
  int turns;          /* ... if this is set, which a change of modes clears */
  real* turned;       /* whether the other direction has been tried for a joint that moved the wrong way */
  memory_t* memory;
  double step; /* length of the steps if the tick is time-stepped, else 0 */
  int yields;      /* whether what holds together has just reached its limits */
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
  segment_t segment;
  clear(numbers, SEGMENT);
  segment.u = 0;
  segment.control = 0;
  segment.p = modes_of(scene, numbers);
  segment.contact = (contact_t*)(numbers + P_LENGTH);
  segment.turning = (turning_t*)(numbers + P_LENGTH + 8 * NC);
  segment.turned = numbers + P_LENGTH + 12 * NC;
  segment.turns = segment.yields = 0;
  segment.memory = 0;
  segment.step = 0.0;
  segment.predicted = 0;
  segment.trace = 0;
  segment.record = 0;
  for (int k = 0; k < NC; ++k) segment.contact[k].ended = STICKS;
  return segment;
}

/* A segment with modes of its own, which begin as another's. */
static segment_t with_modes(const scene_t* scene, const segment_t* segment, modes_t* modes) {
  segment_t other = *segment;
  copy(modes->tunable, segment->p.tunable, P_LENGTH);
  other.p = *modes;
  return other;
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

/* Of the answers at the beginning and at the end of a tick, that for x, compared by its first `count` numbers; or null. */
static const double* answer_at(const real* x, const prediction_t* known, int count, const double* begin, const double* end) {
  return same(x, known->x, count) ? begin : same(x, known->after, count) ? end : 0;
}

static void keep_geometry(const scene_t* scene, const real* x, memory_t* memory, const geometry_t* geometry) {
  const long long place = memory->states++ % STATES;
  copy(memory->x[place], x, 2 * NU);
  copy(memory->geometry[place].place, geometry->place, PLACES);
}

static void find_geometry(const scene_t* scene, const real* x, const segment_t* segment, geometry_t* geometry) {
  const prediction_t* known = segment->predicted;
  if (!NC) return;
  const double* answer = known ? answer_at(x, known, 2 * NU, known->geometry, known->geometry_after) : 0;
  memory_t* memory = segment->memory;
  for (int i = 0; !answer && i < STATES && i < memory->states; ++i)
    if (same(x, memory->x[i], 2 * NU)) answer = memory->geometry[i].place;
  if (answer) {
    copy(geometry->place, answer, PLACES);
    return;
  }
  find_places(scene, x, geometry->place);
  keep_geometry(scene, x, memory, geometry);
}

/* The numbers of the loads at x if they are known; else null. */
static const real* known_loads(const scene_t* scene, const real* x, const segment_t* segment) {
  const prediction_t* known = segment->predicted;
  const memory_t* memory = segment->memory;
  if (is_predicted(scene, segment) && known->rests && same(x, known->x, NX)) return known->loads;
  if (!memory->loaded || !same(x, memory->loads_x, NX)) return 0;
  return same(segment->p.direction, memory->loads_in, MODES) ? memory->loads.load : 0;
}

static void keep_loads(const scene_t* scene, const real* x, const real* modes, memory_t* memory, const loads_t* found) {
  memory->loaded = 1;
  copy(memory->loads.load, found->load, LOADS);
  copy(memory->loads_x, x, NX);
  copy(memory->loads_in, modes, MODES);
}

static void find_loads(const scene_t* scene, const real* x, const segment_t* segment, loads_t* found) {
  const real* known = known_loads(scene, x, segment);
  memory_t* memory = segment->memory;
  if (known) {
    copy(found->load, known, LOADS);
    return;
  }
  memory->work += scene->loads_cost;
  loads_at(scene, x, segment->u, segment->p.tunable, found->load);
  keep_loads(scene, x, segment->p.direction, memory, found);
}

static void find_inertia(const scene_t* scene, const real* x, const segment_t* segment, inertia_t* inertia) {
  const prediction_t* known = segment->predicted;
  segment->memory->work += scene->inertia_cost;
  if (!NC) return;
  if (is_predicted(scene, segment) && known->slides && same(x, known->x, NX)) {
    copy(inertia->W, known->inertia, INERTIA);
    return;
  }
  CALL(scene->contact_inertia, (x, segment->u, segment->p.tunable), (inertia->W, inertia->B, inertia->free));
}

static void find_slope(const scene_t* scene, const real* x, const segment_t* segment, real* slope) {
  const real* found = known_loads(scene, x, segment);
  const real* answer = found ? found + LOADS - NX : 0;
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

/* Torques of compliant stops (at least the penetration), by which contact is detected, on both sides of all joints. */
static void find_pressures(const scene_t* scene, const real* x, double met[2][NU], double push[2][NU]) {
  real found[2 * NU];
  CALL(scene->pressures, (x), (found));
  for (int i = 0; i < NQ; ++i)
    for (int side = 0; side < 2; ++side) {
      push[side][i] = found[NU * side + i];
      met[side][i] = fmin(push[side][i], side ? x[i] - scene->soft_stop[1][i] : scene->soft_stop[0][i] - x[i]);
    }
}

/* Joints in contact with compliant stops: those that press against them, or are about to. */
static void find_pressed(const scene_t* scene, const real* x, segment_t* segment) {
  double met[2][NU], push[2][NU];
  if (!NQ) return;
  find_pressures(scene, x, met, push);
  for (int i = 0; i < NQ; ++i) {
    const real speed = x[NU + i];
    const int lower = met[0][i] > 0.0 || (met[0][i] == 0.0 && speed < 0.0);
    const int upper = met[1][i] > 0.0 || (met[1][i] == 0.0 && speed > 0.0);
    segment->p.pressed[i] = upper - lower;
  }
}

/* Fraction of its normal force up to which a contact sticks: one that creeps has broken away already. */
static double stick_limit(const scene_t* scene, const segment_t* segment, int k) {
  return segment->contact[k].slow != 0.0 ? scene->friction[k] : scene->holding[k];
}

static int is_sliding(const contact_mode_t* mode) { return mode->closed != 0.0 && mode->sticks == 0.0; }

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

/* Speed of a hop off a stop within the rounding of the joint's position, under an acceleration. */
static double rounding_rebound_of_joint(double q, double fall) {
  return LEAST_REBOUND + sqrt(2.0 * fabs(fall) * REBOUND_ROUNDING * (1.0 + fabs(q)));
}

/* Set joints at rest that an impact elsewhere moves off their stops by such a hop; otherwise two alternating ones would
 * never stop. */
static void rest_on_stops(const scene_t* scene, real* x, const segment_t* segment) {
  real slope[NX];
  int known = 0;
  for (int i = 0; i < NU; ++i) {
    const double leaving = -at_stop(scene, x, i) * x[NU + i];
    if (!(leaving > 0.0 && leaving < CERTAIN_REBOUND)) continue;
    if (!known) find_slope(scene, x, segment, slope);
    known = 1;
    if (leaving <= rounding_rebound_of_joint(x[i], slope[NU + i])) x[NU + i] = 0.0;
  }
}

/* Speeds of hops within the rounding of the gap, or shorter than a step. */
static void find_rounding_rebounds(const scene_t* scene, const real* x, const segment_t* segment, const geometry_t* geometry,
                                   double* least_rebound) {
  LOCAL(inertia_t, inertia, inertia_of, INERTIA);
  double fall = 0.0;
  find_inertia(scene, x, segment, &inertia);
  for (int k = 0; k < NC; ++k) fall = fmax(fall, fabs(inertia.free[3 * k]));
  for (int k = 0; k < NC; ++k)
    least_rebound[k] = LEAST_REBOUND + sqrt(2.0 * fall * REBOUND_ROUNDING * geometry->size[k]) + 0.5 * fall * segment->step;
}

/* Contacts whose gap is closed to rounding. */
static void find_closed_gaps(const scene_t* scene, segment_t* segment, const geometry_t* geometry) {
  for (int k = 0; k < NC; ++k) segment->contact[k].touching = geometry->place[3 * k] <= 4 * GAP_ROUNDING * geometry->size[k];
}

/* Contacts whose gap is closed to rounding and does not open. */
static void find_touching(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  contact_t* contact = segment->contact;
  double least_rebound[NC + 1];
  int opens = 0;
  find_closed_gaps(scene, segment, geometry);
  for (int k = 0; k < NC; ++k) opens |= contact[k].touching != 0.0 && geometry->speed[3 * k] > speed_rounding(scene, x);
  if (!opens) return;
  find_rounding_rebounds(scene, x, segment, geometry, least_rebound);
  for (int k = 0; k < NC; ++k) contact[k].touching = contact[k].touching != 0.0 && geometry->speed[3 * k] <= least_rebound[k];
}

/* The end of a contact's last mode determines the initial guess. */
static void guess_from_ended(contact_mode_t* mode, const contact_t* contact) {
  if (contact->touching == 0.0 || contact->ended == STICKS) return;
  if (contact->ended == APART) mode->closed = 0.0;
  if (contact->ended == SLIDES && contact->slides != 0.0) return;
  mode->sticks = 0.0;
  mode->along[0] = contact->ended == SLIDES ? contact->slips[0] : 1.0;
  mode->along[1] = contact->ended == SLIDES ? contact->slips[1] : 0.0;
}

/* Initial guess: moving joints slide and those at rest stick; touching contacts are closed and those at rest stick. */
static void guess_from_velocities(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  for (int i = 0; i < ND; ++i) {
    segment->p.direction[i] = rests(scene, x, i) ? 0.0 : may_stick(scene, i) ? sign_of(x[NU + i]) : 1.0;
    segment->turned[i] = 0;
  }
  find_pressed(scene, x, segment);
  real value[NK + 1], size[NK + 1];
  find_switches(scene, x, segment, value, size);
  for (int k = 0; k < NK; ++k) segment->p.switches[k] = value[k] >= 0.0;
  find_touching(scene, x, segment, geometry);
  for (int k = 0; k < NC; ++k) {
    contact_t* contact = segment->contact + k;
    const real* s = geometry->speed + 3 * k + 1;
    const double size = hypot(s[0], s[1]);
    const int still = scene->holding[k] > 0.0 && (size <= scene->slowest || contact->slow != 0.0),
              turns = scene->friction[k] > 0.0 && !still;
    contact->slides = !still;
    contact->given[0] = turns ? s[0] / size : 1.0;
    contact->given[1] = turns ? s[1] / size : 0.0;
    contact_mode_t* mode = segment->p.contact + k;
    mode->closed = contact->touching;
    mode->sticks = contact->touching != 0.0 && still;
    for (int i = 0; i < 2; ++i) mode->along[i] = contact->given[i];
    mode->fixed = still;
    guess_from_ended(mode, contact);
  }
}

static void find_statics(const scene_t* scene, const real* x, const segment_t* segment, statics_t* found) {
  segment->memory->work += scene->statics_cost;
  CALL(scene->statics, (x, segment->u, segment->p.tunable), (found->push, found->reaction, found->capacity, found->drift));
}

/* What is held, with its reactions of the least norm and its limits. */
static void find_parts(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* found,
                       const statics_t* balance, part_t* parts) {
  for (int i = 0; i < NU; ++i) {
    const int side = ND ? at_stop(scene, x, i) : 0;
    parts[i] = loose;
    parts[i].held = ND && segment->p.direction[i] == 0.0;
    parts[i].force[0] = balance->reaction[i];
    parts[i].least = side < 0 ? -INFINITY : -balance->capacity[NU + i];
    parts[i].most = side > 0 ? INFINITY : balance->capacity[i];
  }
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t* mode = segment->p.contact + k;
    part_t* part = parts + NU + k;
    *part = loose;
    part->held = mode->closed != 0.0;
    part->most = INFINITY;
    part->fraction = stick_limit(scene, segment, k);
    part->sticks = part->held && mode->sticks != 0.0;
    for (int i = 0; i < 3; ++i) part->force[i] = found->force[3 * k + i];
  }
}

/* Which parts hold together, and whether they do. */
static void find_sets_held(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* found,
                           indeterminate_t* together) {
  LOCAL(statics_t, balance, statics_of, STATICS);
  part_t parts[PARTS];
  find_statics(scene, x, segment, &balance);
  find_parts(scene, x, segment, found, &balance, parts);
  find_indeterminate(scene, &balance, parts, segment->yields, together);
}

/* By how much a set exceeds its limits: not positive if it holds. */
static double set_excess(const segment_t* segment, const indeterminate_t* together, int number) {
  return together->excess[number] - (segment->yields ? -EDGE : HOLDS);
}

/* Release parts of a set in the motion in which it gives way: joints at stops, or all others; 0 if there are none. */
static int release(const scene_t* scene, const real* x, segment_t* segment, const indeterminate_t* together, int number,
                   int at_stops) {
  int any = 0;
  for (int i = 0; i < PARTS; ++i) {
    const double *way = together->way + 2 * i, size = hypot(way[0], way[1]);
    const int stopped = i < NU && at_stop(scene, x, i) != 0;
    if (together->set[i] != number || together->share[i] <= LEAST_SHARE || stopped != at_stops) continue;
    any = 1;
    if (i < NU) {
      segment->p.direction[i] = sign_of(way[0]);
      segment->turned[i] = 0;
      continue;
    }
    contact_mode_t* mode = segment->p.contact + i - NU;
    if (mode->sticks == 0.0 || size < OPENS * together->share[i]) mode->closed = 0.0;
    if (mode->closed == 0.0) continue;
    mode->sticks = 0.0;
    for (int j = 0; j < 2; ++j) mode->along[j] = way[j] / size;
  }
  return any;
}

/* Release a set. In its motion contacts that slide rise by their friction coefficient, which they do not do in fact: that
 * must not lift joints off their stops. */
static void let_go(const scene_t* scene, const real* x, segment_t* segment, const indeterminate_t* together, int number) {
  if (!release(scene, x, segment, together, number, 0)) release(scene, x, segment, together, number, 1);
}

/* Joints at rest that loops in motion take along: with all of them held, the constraints could not be satisfied. */
static int find_carried(const scene_t* scene, const real* x, const segment_t* segment, int* carried) {
  LOCAL(statics_t, balance, statics_of, STATICS);
  double T[NM * (NU + 1) + 1];
  int basic[NM + 1], column[NU], moving = 0, count = 0, any = 0;
  const double fastest = largest_of(x + NU, NU);
  for (int i = 0; i < NU; ++i) {
    carried[i] = 0;
    moving += !rests(scene, x, i);
  }
  if (moving == NU) return 0;
  find_statics(scene, x, segment, &balance);
  for (int i = 0; i < NU; ++i) column[i] = rests(scene, x, i) ? moving + i - count : count++;
  for (int k = 0; k < NM; ++k) {
    const double largest = largest_of(balance.push + NU * k, NU), size = largest > 0.0 ? largest : 1.0;
    for (int i = 0; i < NU; ++i) T[(NU + 1) * k + column[i]] = balance.push[i + NU * k] / size;
    T[(NU + 1) * k + NU] = balance.drift[k] / size;
    basic[k] = -1;
  }
  eliminate(NM, NU + 1, T, 0, moving, basic);
  for (int k = 0; k < NM; ++k) {
    const double* row = T + (NU + 1) * k;
    if (basic[k] >= 0 || fabs(row[NU]) <= CARRYING * fastest * fastest) continue;
    for (int i = 0; i < NU; ++i) carried[i] |= rests(scene, x, i) && fabs(row[column[i]]) > CARRYING;
  }
  for (int i = 0; i < NU; ++i) any |= carried[i];
  return any;
}

/* In a moving loop, a joint that passes through rest may be driven by the loop: begin with its direction. */
static void guess_turning(const scene_t* scene, const real* x, segment_t* segment) {
  real slope[NX];
  int carried[NU];
  if (!(scene->constrained && ND) || !find_carried(scene, x, segment, carried)) return;
  for (int i = 0; i < ND; ++i)
    if (carried[i]) segment->p.direction[i] = 1.0;
  find_slope(scene, x, segment, slope);
  for (int i = 0; i < ND; ++i) {
    const double way = sign_of(slope[NU + i]);
    if (carried[i]) segment->p.direction[i] = way * at_stop(scene, x, i) > 0.0 ? 0.0 : way;
  }
}

/* Excess of the torque on a joint at rest over the capacity of friction and its stop: not positive if they hold it. */
static double joint_excess(const scene_t* scene, const real* x, const loads_t* found, int joint) {
  const double load = found->load[joint];
  const int side = at_stop(scene, x, joint);
  return (side ? -side * load : fabs(load)) - scene->static_level[joint];
}

/* Violation of the limits of its force by a contact: not positive if satisfied. */
static double force_excess(const scene_t* scene, const segment_t* segment, const loads_t* found, int k) {
  const real* r = found->force + 3 * k;
  const contact_mode_t* mode = segment->p.contact + k;
  if (mode->closed == 0.0) return 0.0;
  if (r[0] < 0.0) return -r[0];
  return mode->sticks != 0.0 ? hypot(r[1], r[2]) - stick_limit(scene, segment, k) * r[0] : 0.0;
}

/* Violation of the laws by the acceleration of a contact that opens, or starts to slide. */
static double rate_excess(const segment_t* segment, const loads_t* found, int k, double fastest) {
  const real* a = found->rate + 3 * k;
  const contact_mode_t* mode = segment->p.contact + k;
  if (mode->closed == 0.0) return segment->contact[k].touching != 0.0 ? -a[0] / fastest - SLACK : 0.0;
  if (mode->sticks != 0.0 || segment->contact[k].slides != 0.0) return 0.0;
  const double ahead = mode->along[0] * a[1] + mode->along[1] * a[2], astray = mode->along[0] * a[2] - mode->along[1] * a[1];
  return fmax(-ahead, fabs(astray)) / fastest - SLACK;
}

/* Whether reactions of the least norm are beyond a limit. */
static int anything_beyond(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* found) {
  int any = segment->yields;
  for (int k = 0; k < NC; ++k) any |= force_excess(scene, segment, found, k) > 0.0;
  for (int i = 0; i < ND; ++i) any |= segment->p.direction[i] == 0.0 && joint_excess(scene, x, found, i) > 0.0;
  return any;
}

/* The entry with the largest, or just the first, violation: a contact, or NC plus a joint; -1 if there is none. `set`
 * receives the number of the set to which the violated limit belongs, or 0. */
static int find_infeasible(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* found, int first,
                           indeterminate_t* together, int* set) {
  const double heaviest = 1.0 + largest_of(found->force, MC), fastest = 1.0 + largest_of(found->rate, MC);
  const real* d = segment->p.direction;
  double most = 0.0;
  int worst = -1, resting = 0;
  for (int i = 0; i < NU + NC; ++i) together->set[i] = 0;
  if (scene->indeterminate && anything_beyond(scene, x, segment, found)) find_sets_held(scene, x, segment, found, together);
  for (int k = 0; k < NC; ++k) {
    const int number = (int)together->set[NU + k];
    const double beyond = number ? set_excess(segment, together, number) : force_excess(scene, segment, found, k) / heaviest;
    const double excess = beyond > 0.0 ? beyond : rate_excess(segment, found, k, fastest);
    if (excess > most) {
      most = excess;
      worst = k;
      *set = beyond > 0.0 ? number : 0;
    }
  }
  for (int i = 0; i < ND; ++i) resting |= rests(scene, x, i);
  if (!resting) return worst;
  const real* a = found->slope + NU;
  const double quickest = 1.0 + largest_of(a, NU), level = largest_of(scene->static_level, NU),
               highest = level > 0.0 ? level : 1.0;
  for (int i = 0; i < ND; ++i) {
    if (!rests(scene, x, i)) continue;
    const int number = (int)together->set[i];
    const double excess = number        ? set_excess(segment, together, number)
                          : d[i] == 0.0 ? joint_excess(scene, x, found, i) / highest
                                        : -d[i] * a[i] / quickest - SLACK;
    if (excess > most) {
      most = excess;
      worst = NC + i;
      *set = number;
      if (first) return worst;
    }
  }
  return worst;
}

static void put_mode(contact_mode_t* mode, const answer_t* answer) {
  mode->closed = answer->state == SLIDES || answer->state == STICKS;
  mode->sticks = answer->state == STICKS;
  mode->along[0] = answer->direction[0];
  mode->along[1] = answer->direction[1];
}

static void let_slip(answer_t* answer, const double* force) {
  const double size = hypot(force[1], force[2]);
  answer->state = SLIDES;
  for (int i = 0; i < 2; ++i) answer->direction[i] = -force[1 + i] / size;
}

/* Change the entry to a mode that satisfies the laws while the others are unchanged: 0 if none does. */
static int pivot(const scene_t* scene, const real* x, segment_t* segment, const loads_t* found, int entry) {
  if (entry >= NC) {
    const int joint = entry - NC, turns = scene->constrained && segment->turned[joint] == 0.0 && !at_stop(scene, x, joint);
    real* d = segment->p.direction + joint;
    segment->turned[joint] = *d != 0.0 && turns;
    *d = *d == 0.0 ? sign_of(found->load[joint]) : turns ? -*d : 0.0;
    return 1;
  }
  LOCAL(inertia_t, inertia, inertia_of, INERTIA);
  double block[3][3], c[3];
  const real* r = found->force + 3 * entry;
  const contact_t* contact = segment->contact + entry;
  contact_mode_t* mode = segment->p.contact + entry;
  find_inertia(scene, x, segment, &inertia);
  own_block(scene, inertia.W, entry, block);
  for (int i = 0; i < 3; ++i)
    c[i] = found->rate[3 * entry + i] - (block[i][0] * r[0] + block[i][1] * r[1] + block[i][2] * r[2]);
  answer_t answer = single(block, c, scene->friction[entry], stick_limit(scene, segment, entry),
                           contact->slides != 0.0 ? contact->given : 0);
  if (answer.state == UNSOLVABLE) return 0;
  if (answer.state == STICKS && mode->closed != 0.0 && mode->sticks != 0.0) let_slip(&answer, r); /* on the boundary */
  put_mode(mode, &answer);
  return 1;
}

/* Forces of all contacts together. Of redundant ones those of the least norm, as the generated functions find them, by the
 * same iteration with larger steps: the directions in which contacts start to slide depend on each one's share of the load.
 */
static int solve_of_least_norm(const scene_t* scene, cones_t* cones, const inertia_t* inertia, answer_t* answers) {
  double W[MC * MC + 1], c[MC + 1], damping[MC + 1], trace = 0.0;
  int solved = 1;
  for (int i = 0; i < MC; ++i) trace += AT(inertia->W, MC, i, i);
  for (int i = 0; i < MC * MC; ++i) W[i] = inertia->W[i];
  for (int i = 0; i < MC; ++i) {
    damping[i] = NEARER * scale_of(AT(W, MC, i, i), trace);
    AT(W, MC, i, i) += damping[i];
    c[i] = inertia->free[i];
  }
  cones->W = W;
  cones->c = c;
  for (int turn = 0; turn < NEARER_TURNS && solved; ++turn) {
    solved = several(scene, cones, answers);
    for (int i = 0; i < MC; ++i) c[i] = inertia->free[i] - damping[i] * answers[i / 3].force[i % 3];
  }
  cones->W = inertia->W;
  cones->c = inertia->free;
  return solved || several(scene, cones, answers);
}

/* Solve all contacts together, where pivoting cycles, with or without their static friction: without, there is a solution,
 * which the law with it allows. The modes are kept if none is found. */
static void solve_all_contacts(const scene_t* scene, const real* x, segment_t* segment, int with_static) {
  LOCAL(inertia_t, inertia, inertia_of, INERTIA);
  double limit[NC + 1];
  answer_t answers[NC + 1];
  LOCAL(cones_t, cones, cones_of, CONES);
  cones.friction = scene->friction;
  cones.holding = limit;
  find_inertia(scene, x, segment, &inertia);
  for (int k = 0; k < NC; ++k) {
    limit[k] = with_static ? stick_limit(scene, segment, k) : scene->friction[k];
    cones.slides[k] = segment->contact[k].slides;
    cones.allowed[k] = segment->contact[k].touching;
    for (int i = 0; i < 2; ++i) cones.given[2 * k + i] = segment->contact[k].given[i];
  }
  if (!solve_of_least_norm(scene, &cones, &inertia, answers)) return;
  for (int k = 0; k < NC; ++k) {
    const double *r = answers[k].force, size = hypot(r[1], r[2]);
    /* On the boundary of its cone: where contacts are redundant, the forces of least norm would leave it. */
    if (answers[k].state == STICKS && size >= (1.0 - EDGE) * limit[k] * r[0] && size > 0.0) let_slip(answers + k, r);
    put_mode(segment->p.contact + k, answers + k);
  }
}

/* Whether a contact touches or a joint that may be held is at rest; else there are no modes to find. */
static int anything_rests(const scene_t* scene, const real* x, const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->contact[k].touching != 0.0;
  for (int i = 0; i < ND; ++i) any |= rests(scene, x, i);
  return any;
}

/* Whether friction closes a sliding contact faster than its normal force opens it. One whose normal force moves nothing, since
 * a stop bears it, does not. */
static int any_jams(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* found) {
  LOCAL(inertia_t, inertia, inertia_of, INERTIA);
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= is_sliding(segment->p.contact + k) && !(found->grip[k] > 0.0);
  if (!any) return 0;
  find_inertia(scene, x, segment, &inertia);
  any = 0;
  for (int k = 0; k < NC; ++k)
    any |= is_sliding(segment->p.contact + k) && !(found->grip[k] > 0.0) && AT(inertia.W, MC, 3 * k, 3 * k) > 0.0;
  return any;
}

static void guess_modes(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  guess_from_velocities(scene, x, segment, geometry);
  if (scene->constrained && largest_of(x + NU, NU) > 0.0) guess_turning(scene, x, segment);
}

/* Try the modes of all joints at rest, with all contacts solved together for each: 1 if one satisfies the laws. This is the
 * last resort where pivoting cycles between joints and contacts. */
static int try_all(const scene_t* scene, const real* x, segment_t* segment) {
  int resting[NU], count = 0, sets = 1;
  LOCAL(loads_t, found, loads_of, LOADS);
  LOCAL(indeterminate_t, together, indeterminate_of, INDETERMINATE);
  for (int i = 0; i < ND; ++i)
    if (rests(scene, x, i)) resting[count++] = i;
  for (int i = 0; i < count && sets <= MOST_SETS; ++i) sets *= 3;
  for (int number = 0; number < (sets < MOST_SETS ? sets : MOST_SETS); ++number)
    for (int with_static = 1; with_static >= 0; --with_static) {
      int set = 0;
      for (int i = 0, rest = number; i < count; ++i, rest /= 3)
        segment->p.direction[resting[i]] = rest % 3 == 2 ? -1.0 : rest % 3;
      solve_all_contacts(scene, x, segment, with_static);
      find_loads(scene, x, segment, &found);
      if (find_infeasible(scene, x, segment, &found, 0, &together, &set) < 0 && !any_jams(scene, x, segment, &found)) return 1;
    }
  return 0;
}

/* Find the modes of all contacts and joints: 0 if none satisfies the laws, or the motion is not unique (Painlevé 1895). */
static int solve_modes(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  LOCAL(loads_t, found, loads_of, LOADS);
  LOCAL(indeterminate_t, together, indeterminate_of, INDETERMINATE);
  segment->turns = 0;
  guess_modes(scene, x, segment, geometry);
  if (!anything_rests(scene, x, segment)) return 1;
  for (int attempt = 0; attempt < 3; ++attempt) {
    for (int k = 0; k < PIVOTS; ++k) {
      find_loads(scene, x, segment, &found);
      int set = 0;
      const int entry = find_infeasible(scene, x, segment, &found, k >= WORST_FIRST, &together, &set);
      if (entry < 0) { return !any_jams(scene, x, segment, &found); }
      if (scene->indeterminate && set) {
        let_go(scene, x, segment, &together, set);
        continue;
      }
      if (!pivot(scene, x, segment, &found, entry)) break;
    }
    if (NC && attempt < 2) solve_all_contacts(scene, x, segment, attempt == 0);
  }
  return NC > 0 && ND > 0 && try_all(scene, x, segment);
}

/* Determine the modes of all joints and contacts at x under u, with the tunable quantities of p given; returns NONE or the
 * reason of a failure. */
EXPORTED long long find_modes(const scene_t* scene, const real* x, const real* u, real* p) {
  LOCAL_TICK(segment, u);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  copy(segment.p.tunable, p, P_LENGTH);
  find_geometry(scene, x, &segment, &geometry);
  const int settled = solve_modes(scene, x, &segment, &geometry);
  copy(p, segment.p.tunable, P_LENGTH);
  return settled ? NONE : UNDETERMINED;
}

/* Change of the reactions of the least norm in given modes, those of contacts (normal, and tangential ones where they stick)
 * and then of joints, to the nearest within all limits. */
EXPORTED void share_reactions(const scene_t* scene, const real* x, const real* u, const real* p, double* change) {
  LOCAL_TICK(segment, u);
  LOCAL(loads_t, found, loads_of, LOADS);
  LOCAL(statics_t, balance, statics_of, STATICS);
  part_t parts[PARTS];
  copy(segment.p.tunable, p, P_LENGTH);
  for (int i = 0; i < FORCES; ++i) change[i] = 0.0;
  if (!scene->indeterminate) return;
  find_loads(scene, x, &segment, &found);
  find_statics(scene, x, &segment, &balance);
  find_parts(scene, x, &segment, &found, &balance, parts);
  find_nearest(scene, &balance, parts, change);
}
