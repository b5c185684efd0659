/* SPDX-License-Identifier: Apache-2.0
 *
 * Smooth segments between events: how long the modes remain valid, and corrections at the ends.
 */

#pragma once
#include "contact/impact.h"
#include "events/smoothness.h"

#define TURNING_BACK 1e-13 /* relative speed in the wrong direction tolerated of a joint that begins to slide */
#define SUDDEN_STOP 1e-6   /* speed tolerated of a joint that is found to stop, relative to the fastest joint */
#define SINKING 1e-12      /* speed up to which an open contact is not treated as approaching */
#define REST_SPEED 1e-9          /* speed treated as rounding if all joints of an arm are held */
#define INDEPENDENT 1e-10  /* part of a row that must be left by those before it, for it to count for the rank */
#define MOST_PARTS 32      /* segments of a tick in which a contact that creeps in one direction is looked at */
#define TURN_ERROR 1e-8    /* error of its velocity by a turn in a step of fixed length */
#define RESTING_DRIFT \
  (0.5 * scene->slowest) /* speed of a contact across its direction when it comes to rest, which is rest ... */
/* ... and while it slides, that need not be followed */
#define DRIFT(segment) (scene->adaptive ? 10.0 * (segment)->control->tolerance : TURN_ERROR)
#define PROJECTED 1e-9      /* correction to contacts whose square is far below rounding: a second step is unnecessary */
#define SWITCH_ROUNDING 1e-13 /* of a comparison, relative to what is compared */
#define VIOLATION_ROUNDING 1e-15       /* violation treated as rounding */
#define ARRIVAL_MARGIN 1.2          /* time at which a mode has certainly ended, as a multiple of the predicted one ... */
#define SEARCH_FACTOR 4.0         /* ... and the next trial if no mode has ended by then */
#define GUARD_SAMPLES 4             /* parts of a step at whose ends modes are looked at where one may end inside it, ... */
#define SAMPLE_PHASE 3.0      /* ... and as many for every further phase of its waves, in [rad], ... */
#define MOST_GUARD_SAMPLES 64       /* ... but not more than these */
#define SLOWED 0.25         /* ratio of the speeds of a sliding contact at its ends */
#define PEAK_MARGIN 0.6     /* error of the largest sample of a guard, relative to the second difference of samples ... */
#define PEAK_DOUBT 0.1      /* ... and of its value at a predicted maximum, relative to the differences ... */
#define PEAK_GAIN 1e-2      /* ... which falls by this factor with every prediction ... */
#define PEAK_TRIALS 8       /* ... of at most so many */
#define EARLIER 4           /* earlier events that are looked for before one that was found */

/* A step of the method in a segment, with its continuous output: derivatives at its ends, and the state in its middle. */
typedef struct {
  real *begin, *end, *inside;
  loads_t near;  /* load and force alone, where the method has a stage at the end ... */
  int nears;     /* ... and this is set */
  double from;   /* its beginning since that of the segment */
  double length;
} piece_t;
#define PIECE (5 * NX + NEARS)

static piece_t piece_of(const scene_t* scene, real* numbers) {
  real* near = numbers + 5 * NX;
  piece_t piece = {numbers, numbers + NX, numbers + 2 * NX, {near, near + NU, 0, 0, 0}, 0, 0.0, 0.0};
  return piece;
}

/* The slope at the beginning of a piece, with which its steps begin; where nothing is held they find it themselves. */
static void begin_piece(const scene_t* scene, const segment_t* segment, piece_t* piece) {
  if (scene->moving && all_moves(scene, segment->p.direction)) return;
  find_slope(scene, piece->begin, segment, piece->inside);
}

/* Make a step of length h from the beginning of a piece: 1 if every number stayed finite. `error` receives the scaled error
 * and that of q, with an estimate. The step may be predicted.
 */
static int make_step(const scene_t* scene, const segment_t* segment, double h, piece_t* piece, real* error) {
  const prediction_t* known = segment->predicted;
  const real length = h;
  const int moves = scene->moving && all_moves(scene, segment->p.direction);
  real *inside = piece->inside, *slope = inside + NX, *middle = slope + NX;
  piece->length = h;
  if (is_predicted(scene, segment) && h == known->length && same(piece->begin, known->x, NX)) {
    copy(piece->end, known->after, NX);
    copy(piece->inside, known->inside, 3 * NX);
    copy(piece->near.load, known->near, NEARS);
    piece->nears = known->nears != 0;
    return within_reach(scene, piece->end);
  }
  piece->nears = !moves && scene->near_loads && STEADY;
  if (moves && scene->adaptive)
    CALL(scene->moving_attempt, (piece->begin, segment->u, segment->p.tunable, &length),
         (piece->end, error, error + 1, inside, slope, middle));
  else if (moves)
    CALL(scene->moving_step, (piece->begin, segment->u, segment->p.tunable, &length), (piece->end, inside, slope, middle));
  else if (scene->adaptive)
    CALL(scene->attempt, (piece->begin, segment->u, segment->p.tunable, &length, inside),
         (piece->end, error, error + 1, slope, middle, piece->near.load, piece->near.force));
  else
    CALL(scene->step, (piece->begin, segment->u, segment->p.tunable, &length, inside),
         (piece->end, slope, middle, piece->near.load, piece->near.force));
  return within_reach(scene, piece->end);
}

/* The state at a fraction of a piece: the polynomial of degree 4 through its ends, their slopes and the middle. */
static void state_inside(const scene_t* scene, const piece_t* piece, double part, real* x) {
  const double h = piece->length, rest = 1.0 - part, a = rest * rest * (1.0 + 2.0 * part), bump = part * part * rest * rest;
  for (int i = 0; i < NX; ++i) {
    const double x0 = piece->begin[i], x1 = piece->end[i], f0 = piece->inside[i], f1 = piece->inside[NX + i];
    const double bend = piece->inside[2 * NX + i] - 0.5 * (x0 + x1) - 0.125 * h * (f0 - f1);
    x[i] = a * x0 + (1.0 - a) * x1 + h * part * rest * (rest * f0 - part * f1) + 16.0 * bump * bend;
  }
}

/* Whether a contact is closed or a joint sticks. */
static int anything_held(const scene_t* scene, const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed != 0.0;
  for (int i = 0; i < ND; ++i) any |= segment->p.direction[i] == 0.0;
  return any;
}

#define MOST_STEPS (scene->adaptive ? scene->most_substeps : 1)

/* Event functions, which must not be positive: of contacts gaps, or normal and tangential forces; of joints friction, and
 * both stops; of the sets that hold together the largest excess, in place of those of their parts. Each is smooth in time
 * while the modes last.
 */
typedef struct {
  double *contact, *joint, *stop, *pressed, *switched, *together;
} guard_values_t;
#define GUARD_VALUES (2 * NC + ND + 2 * NU + 2 * NQ + NK + 1)

static guard_values_t guard_values_of(const scene_t* scene, double* numbers) {
  guard_values_t guards;
  guards.contact = numbers;
  guards.joint = guards.contact + 2 * NC;
  guards.stop = guards.joint + ND;
  guards.pressed = guards.stop + 2 * NU;
  guards.switched = guards.pressed + 2 * NQ;
  guards.together = guards.switched + NK;
  return guards;
}

static void fill(const scene_t* scene, guard_values_t* guards, double value) {
  for (int i = 0; i < GUARD_VALUES; ++i) guards->contact[i] = value;
}
static double worst_of(const scene_t* scene, const guard_values_t* guards) {
  return largest_among(guards->contact, GUARD_VALUES);
}

/* Positive where a joint is beyond a rigid stop, meets a compliant one or separates from it, after a motion of length t. */
static void evaluate_stop_guards(const scene_t* scene, const real* x, const segment_t* segment, double t,
                                 guard_values_t* guards) {
  double met[2][NU], push[2][NU];
  for (int i = 0; scene->rigid && i < NU; ++i) {
    if (segment->p.direction[i] == 0.0) continue;
    const double room = SINKING * t + GAP_ROUNDING * (1.0 + fabs(x[i]));
    guards->stop[2 * i] = scene->rigid_stop[0][i] - x[i] - room;
    guards->stop[2 * i + 1] = x[i] - scene->rigid_stop[1][i] - room;
  }
  if (NQ) find_pressures(scene, x, met, push);
  for (int i = 0; i < NQ; ++i)
    for (int side = 0; side < 2; ++side)
      guards->pressed[2 * i + side] = segment->p.pressed[i] == (side ? 1.0 : -1.0) ? -push[side][i] : met[side][i];
}

/* Speed against its direction that a sliding joint may have by rounding. */
static double turning_rounding(const scene_t* scene, const real* x) { return TURNING_BACK * (1.0 + largest_of(x + NU, NU)); }

/* Replace the guards of parts that hold together by that of their sets, where reactions of the least norm are beyond. */
static void limit_indeterminate(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* found,
                                guard_values_t* guards) {
  LOCAL(indeterminate_t, together, indeterminate_of, INDETERMINATE);
  if (!anything_beyond(scene, x, segment, found)) return;
  find_sets_held(scene, x, segment, found, &together);
  for (int i = 0; i < ND; ++i)
    if (together.set[i] != 0.0) guards->joint[i] = -INFINITY;
  for (int k = 0; k < NC; ++k) {
    if (together.set[NU + k] == 0.0) continue;
    guards->contact[2 * k] = -INFINITY;
    if (segment->p.contact[k].sticks != 0.0) guards->contact[2 * k + 1] = -INFINITY;
  }
  for (int i = 0; i < PARTS; ++i)
    if (together.set[i] != 0.0)
      *guards->together = fmax(*guards->together, set_excess(segment, &together, (int)together.set[i]));
}

/* Whether a contact is apart or slides: its place or speed may end its mode. */
static int any_travels(const scene_t* scene, const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed == 0.0 || segment->p.contact[k].sticks == 0.0;
  return any;
}

/* Whether loads and forces are so far from their guards that those of a state close by are within them. */
static int is_far_from_limits(const scene_t* scene, const segment_t* segment, const loads_t* near, const real* x) {
  double heaviest = 0.0;
  if (segment->yields) return 0;
  for (int k = 0; k < NC; ++k)
    if (segment->p.contact[k].closed != 0.0) heaviest = fmax(heaviest, near->force[3 * k]);
  for (int k = 0; k < NC; ++k) {
    const real* r = near->force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) continue;
    if (!(r[0] > 2.0 * NEAR * heaviest)) return 0;
    if (mode->sticks != 0.0 && !(hypot(r[1], r[2]) < (1.0 - 2.0 * NEAR) * stick_limit(scene, segment, k) * r[0])) return 0;
  }
  for (int i = 0; i < ND; ++i)
    if (segment->p.direction[i] == 0.0
        && (at_stop(scene, x, i) || !(fabs(near->load[i]) < (1.0 - 2.0 * NEAR) * scene->static_level[i])))
      return 0;
  return 1;
}

/* Positive where a contact or joint violates its mode after a motion of length t; returns the largest violation. `near`: the
 * loads at a state close by, which are taken if what is held is held firmly, or null. */
static double evaluate_guards(const scene_t* scene, const real* x, const segment_t* segment, const double* ground, double t,
                              const loads_t* near, guard_values_t* guards) {
  const real *d = segment->p.direction, *v = x + NU;
  const double rounding = turning_rounding(scene, x);
  geometry_t geometry = segment->memory->places_of_guards;
  loads_t found = segment->memory->loads_of_guards;
  real *value = segment->memory->switch_values, *size = value + NK;
  fill(scene, guards, -INFINITY);
  if (any_travels(scene, segment)) find_geometry(scene, x, segment, &geometry);
  if (near && is_far_from_limits(scene, segment, near, x)) found = *near;
  else if (anything_held(scene, segment)) find_loads(scene, x, segment, &found);
  for (int k = 0; k < NC; ++k) {
    const real *r = found.force + 3 * k, *s = geometry.speed + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) {
      guards->contact[2 * k] = ground[k] - geometry.place[3 * k] - SINKING * t - GAP_ROUNDING * geometry.size[k];
      continue;
    }
    guards->contact[2 * k] = -r[0];
    if (mode->sticks != 0.0) guards->contact[2 * k + 1] = hypot(r[1], r[2]) - stick_limit(scene, segment, k) * r[0];
    else if (scene->holding[k] > 0.0) guards->contact[2 * k + 1] = -(mode->along[0] * s[1] + mode->along[1] * s[2]) - rounding;
  }
  for (int i = 0; i < ND; ++i) {
    if (d[i] == 0.0) guards->joint[i] = joint_excess(scene, x, &found, i);
    else if (may_stick(scene, i)) guards->joint[i] = -v[i] * d[i] - rounding;
  }
  if (scene->indeterminate && anything_held(scene, segment)) limit_indeterminate(scene, x, segment, &found, guards);
  evaluate_stop_guards(scene, x, segment, t, guards);
  find_switches(scene, x, segment, value, size);
  for (int k = 0; k < NK; ++k)
    if (size[k] > 0.0) /* else nothing is compared, as the engagement of teeth within their backlash */
      guards->switched[k] = (segment->p.switches[k] != 0.0 ? -value[k] : value[k]) - SWITCH_ROUNDING * size[k];
  return worst_of(scene, guards);
}

/* A piece of a motion in which events are searched. */
typedef struct {
  const scene_t* scene;
  piece_t piece;
  const segment_t* segment;
  double* ground; /* gaps at the beginning of the segment that are negative by rounding */
} search_t;

/* Whether all modes are satisfied at a time in the piece, by a step of that length. */
static double excess_at(const scene_t* scene, const search_t* search, double t, guard_values_t* guards) {
  LOCAL(piece_t, part, piece_of, PIECE);
  real error[2];
  search->segment->memory->work += scene->step_cost;
  copy(part.begin, search->piece.begin, NX);
  copy(part.inside, search->piece.inside, NX);
  copy(part.end, part.begin, NX);
  if (t == 0.0 || make_step(scene, search->segment, t, &part, error))
    return evaluate_guards(scene, part.end, search->segment, search->ground, search->piece.from + t, 0, guards);
  fill(scene, guards, INFINITY);
  return INFINITY;
}

static void guards_at(const void* asked, double t, double* values) {
  const search_t* search = (const search_t*)asked;
  const scene_t* scene = search->scene;
  guard_values_t guards = guard_values_of(scene, values);
  excess_at(scene, search, t, &guards);
}

/* Bounds of a number of the state inside a piece. */
static void find_bounds(const scene_t* scene, const piece_t* piece, int i, double* low, double* high) {
  bound_inside(scene, piece->begin, piece->end, piece->inside, piece->length, i, low, high);
}

/* Whether the speed of a sliding joint may reach zero inside a piece, or a joint its stop. */
static int joint_may_cross(const scene_t* scene, const piece_t* piece, const segment_t* segment, int i) {
  double low, high;
  if (ND && may_stick(scene, i)) { /* if it does not turn, it meets a stop at most once */
    find_bounds(scene, piece, NU + i, &low, &high);
    return segment->p.direction[i] > 0.0 ? low <= 0.0 : high >= 0.0;
  }
  find_bounds(scene, piece, i, &low, &high);
  return low <= scene->stop_place[0][i] || high >= scene->stop_place[1][i];
}

/* Whether a contact may end or change its mode inside a piece that satisfies it at both ends. */
static int contact_may_cross(const scene_t* scene, const segment_t* segment, const geometry_t* begin, const geometry_t* end,
                             double h, int k) {
  const contact_mode_t* mode = segment->p.contact + k;
  const real *s0 = begin->speed + 3 * k, *s1 = end->speed + 3 * k;
  if (mode->closed == 0.0) {
    double low, high;
    bound_cubic(begin->place[3 * k], s0[0], end->place[3 * k], s1[0], h, &low, &high);
    return low <= NEAR * (high - low);
  }
  if (mode->sticks != 0.0 || !(scene->holding[k] > 0.0)) return 0;
  const double ahead0 = mode->along[0] * s0[1] + mode->along[1] * s0[2],
               ahead1 = mode->along[0] * s1[1] + mode->along[1] * s1[2];
  return fmin(ahead0, ahead1) <= SLOWED * fmax(ahead0, ahead1);
}

/* Whether something that holds is close to its limit at the end of a piece, or loads vary within it; under error control,
 * where pieces are long, and with internal states, whether anything holds.
 */
static int load_may_cross(const scene_t* scene, const piece_t* piece, const segment_t* segment, const guard_values_t* end) {
  if (!anything_held(scene, segment)) return 0;
  if (scene->adaptive) return 1;
  if (NX > 2 * NU || !varies_evenly(scene, piece->begin, piece->end, piece->inside, piece->length)) return 1;
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) continue;
    const double push = -end->contact[2 * k];
    for (int l = 0; l < NC; ++l)
      if (segment->p.contact[l].closed != 0.0 && push < -NEAR * end->contact[2 * l]) return 1;
    if (mode->sticks != 0.0 && scene->holding[k] > 0.0
        && end->contact[2 * k + 1] > -NEAR * stick_limit(scene, segment, k) * push)
      return 1;
  }
  for (int i = 0; i < ND; ++i)
    if (segment->p.direction[i] == 0.0 && end->joint[i] > -NEAR * scene->static_level[i]) return 1;
  return *end->together > -NEAR;
}

/* Whether a drive or cord may switch inside a piece and back: whether it comes close, as the middle shows, or a wave passes. */
static int switch_may_cross(const scene_t* scene, const piece_t* piece, const segment_t* segment, const guard_values_t* end) {
  real x[NX], value[NK + 1], size[NK + 1], middle[NK + 1];
  if (!NK) return 0;
  if (phase_of(scene, piece->begin, piece->end) > 1.0) return 1;
  state_inside(scene, piece, 0.5, x);
  find_switches(scene, x, segment, middle, size);
  find_switches(scene, piece->begin, segment, value, size);
  for (int k = 0; k < NK; ++k) {
    const double far = segment->p.switches[k] != 0.0 ? 1.0 : -1.0, a = far * value[k], b = far * middle[k],
                 c = -end->switched[k];
    if (fmin(fmin(a, b), c) <= 0.5 * (fmax(fmax(a, b), c) - fmin(fmin(a, b), c))) return 1;
  }
  return 0;
}

/* Whether a mode may end inside a piece that satisfies all of them at both ends. */
static int may_cross(const scene_t* scene, const search_t* search, const guard_values_t* end) {
  const piece_t* piece = &search->piece;
  const segment_t* segment = search->segment;
  for (int i = 0; i < NU; ++i)
    if (!(ND && segment->p.direction[i] == 0.0) && joint_may_cross(scene, piece, segment, i)) return 1;
  if (load_may_cross(scene, piece, segment, end) || switch_may_cross(scene, piece, segment, end)) return 1;
  if (any_travels(scene, segment)) {
    LOCAL(geometry_t, first, geometry_of, PLACES);
    LOCAL(geometry_t, last, geometry_of, PLACES);
    find_geometry(scene, piece->begin, segment, &first);
    find_geometry(scene, piece->end, segment, &last);
    for (int k = 0; k < NC; ++k)
      if (contact_may_cross(scene, segment, &first, &last, piece->length, k)) return 1;
  }
  return 0;
}

/* Vertex of the parabola through three points, relative to the middle one; NAN if it has no maximum between them. */
static double vertex_of(const double* t, const double* f) {
  const double left = (f[1] - f[0]) / (t[1] - t[0]), right = (f[2] - f[1]) / (t[2] - t[1]);
  const double bend = (right - left) / (t[2] - t[0]), slope = left + bend * (t[1] - t[0]), way = -slope / (2.0 * bend);
  return bend < 0.0 && way >= t[0] - t[1] && way <= t[2] - t[1] ? way : NAN;
}

/* Search the maximum of a guard, which was predicted between three times: a time at which the guard is positive, or 0. */
static double peak_of(const scene_t* scene, const search_t* search, int guard, double* t, double* f, guard_values_t* guards) {
  double doubt = PEAK_DOUBT * (fabs(f[1] - f[0]) + fabs(f[1] - f[2]));
  for (int k = 0; k < PEAK_TRIALS; ++k, doubt *= PEAK_GAIN) {
    const double way = vertex_of(t, f), trial = t[1] + way;
    if (!(trial > t[0] && trial < t[2])) return 0.0;
    excess_at(scene, search, trial, guards);
    const double value = guards->contact[guard];
    if (value > 0.0) return value < INFINITY ? trial : 0.0;
    if (value < -doubt || trial == t[1]) return 0.0;
    const int later = trial > t[1], better = value >= f[1];
    const int moved = better ? (later ? 0 : 2) : (later ? 2 : 0); /* the end of the bracket that is replaced */
    t[moved] = better ? t[1] : trial;
    f[moved] = better ? f[1] : value;
    if (better) {
      t[1] = trial;
      f[1] = value;
    }
  }
  return 0.0;
}

/* A time inside a piece at which a mode is violated though it is satisfied at both ends; 0 if the motion shows none.
 *
 * Guards are sampled on the method's continuous output; where their samples have a maximum that may be positive, the motion
 * itself is evaluated there.
 */
static double find_crossing(const scene_t* scene, const search_t* search, const guard_values_t* end, guard_values_t* guards) {
  const piece_t* piece = &search->piece;
  if (!may_cross(scene, search, end)) return 0.0;
  double sample_numbers[3 * GUARD_VALUES];
  guard_values_t sample[3]; /* the last three */
  real x[NX];
  for (int k = 0; k < 3; ++k) sample[k] = guard_values_of(scene, sample_numbers + k * GUARD_VALUES);
  const double phase = phase_of(scene, piece->begin, piece->end), parts = GUARD_SAMPLES * (1.0 + floor(phase / SAMPLE_PHASE));
  const int samples = (int)fmin(parts, MOST_GUARD_SAMPLES);
  const double step = piece->length / samples;
  for (int k = 0; k <= samples; ++k) {
    guard_values_t* last = sample + k % 3;
    state_inside(scene, piece, (double)k / samples, x);
    if (k == samples) *last = *end;
    else evaluate_guards(scene, x, search->segment, search->ground, piece->from + k * step, 0, last);
    for (int guard = 0; k > 1 && guard < GUARD_VALUES; ++guard) {
      double t[3] = {(k - 2) * step, (k - 1) * step, k * step}, f[3];
      for (int i = 0; i < 3; ++i) f[i] = sample[(k + 1 + i) % 3].contact[guard];
      const double bend = 2.0 * f[1] - f[0] - f[2];
      const double way = fmax(f[1], fmax(f[0], f[2])) + PEAK_MARGIN * bend > 0.0 ? vertex_of(t, f) : NAN;
      if (way != way) continue;
      const double found = peak_of(scene, search, guard, t, f, guards);
      if (found > 0.0) return found;
    }
  }
  return 0.0;
}

/* Time to cover the distance `way` at constant acceleration: INFINITY if never. */
static double arrival(double way, double speed, double push) {
  const double square = speed * speed + 2.0 * push * way;
  if (square < 0.0) return INFINITY;
  const double root = sqrt(square), time = speed > 0.0 ? 2.0 * way / (speed + root) : (root - speed) / push;
  return time > 0.0 ? time : INFINITY;
}

/* Interval around the end of the first mode at constant accelerations: a contact touches, a joint meets a rigid stop or
 * comes to rest in friction. It shortens the search where impacts follow one another. Infinite if no mode ends.
 */
static double find_next(const scene_t* scene, const real* x, const segment_t* segment, const geometry_t* geometry) {
  double soonest = INFINITY;
  real slope[NX];
  LOCAL(loads_t, found, loads_of, LOADS);
  int apart = 0;
  for (int k = 0; k < NC; ++k) apart |= segment->p.contact[k].closed == 0.0;
  if (apart) find_loads(scene, x, segment, &found);
  find_slope(scene, x, segment, slope);
  for (int i = 0; i < NU; ++i) {
    const double v = x[NU + i], a = slope[NU + i];
    if (may_stick(scene, i) && v * a < 0.0) soonest = fmin(soonest, -v / a);
    if (!scene->rigid || segment->p.direction[i] == 0.0) continue;
    const double below = GAP_ROUNDING * (1.0 + fabs(x[i]));
    soonest = fmin(soonest, fmin(arrival(x[i] - scene->rigid_stop[0][i] + below, -v, -a),
                                 arrival(scene->rigid_stop[1][i] - x[i] + below, v, a)));
  }
  for (int k = 0; k < NC; ++k) {
    const double gap = fmax(geometry->place[3 * k], 0.0) + GAP_ROUNDING * geometry->size[k];
    if (segment->p.contact[k].closed == 0.0)
      soonest = fmin(soonest, arrival(gap, -geometry->speed[3 * k], -found.rate[3 * k]));
  }
  return ARRIVAL_MARGIN * soonest;
}

/* End a piece at the first violation of a mode in it, known at a time `known` with `guards`: its length, -1 if it cannot be
 * computed. `error` is that of its last step.
 */
static double end_at_event(const scene_t* scene, search_t* search, double known, guard_values_t* guards, real* error) {
  piece_t* piece = &search->piece;
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL(guard_values_t, early, guard_values_of, GUARD_VALUES);
  double room[4 * GUARD_VALUES];
  find_geometry(scene, piece->begin, search->segment, &geometry);
  for (double near = find_next(scene, piece->begin, search->segment, &geometry); near < known; near *= SEARCH_FACTOR) {
    if (!(excess_at(scene, search, near, &early) > 0.0)) continue;
    known = near;
    copy(guards->contact, early.contact, GUARD_VALUES);
  }
  for (int turn = 0; turn < EARLIER; ++turn) {
    const double length = first_positive(guards_at, search, GUARD_VALUES, known, guards->contact, VIOLATION_ROUNDING, room);
    if (!make_step(scene, search->segment, length, piece, error)) return -1.0;
    evaluate_guards(scene, piece->end, search->segment, search->ground, piece->from + length, 0, &early);
    known = find_crossing(scene, search, &early, guards);
    if (known == 0.0) return length;
  }
  return piece->length;
}

/* A time in a piece of length h, whose end may be out of reach, at which a mode is violated; 0 if all are satisfied. */
static double find_violation(const scene_t* scene, const search_t* search, double h, int reached, guard_values_t* guards) {
  const piece_t* piece = &search->piece;
  const loads_t* near = piece->nears ? &piece->near : 0;
  LOCAL(guard_values_t, peak, guard_values_of, GUARD_VALUES);
  if (!reached) fill(scene, guards, INFINITY);
  if (!reached || evaluate_guards(scene, piece->end, search->segment, search->ground, piece->from + h, near, guards) > 0.0)
    return h;
  const double known = find_crossing(scene, search, guards, &peak);
  if (known > 0.0) copy(guards->contact, peak.contact, GUARD_VALUES);
  return known;
}

/* Whether an accepted attempt that an event cuts to `length` is accurate, with its error `size` then: an attempt that passes
 * over what happens close to the event may not notice it. If not, a shorter one is to be tried from the same beginning.
 */
static int is_accurate_cut(const scene_t* scene, substeps_t* at, double h, double length, double size) {
  if (size <= 1.0 || length < 1e-12 * h) return 1;
  const double factor = 0.9 * pow(size, -1.0 / scene->order);
  at->done -= at->trial;
  at->step = length * (factor > 0.2 ? factor : 0.2);
  return 0;
}

/* Note a step of a traced tick. */
static void record_step(const segment_t* segment, double length) {
  trace_t* trace = segment->trace;
  if (!segment->record) return;
  if (trace->taken < trace->most_steps) trace->steps[trace->taken] = length;
  ++trace->taken;
  segment->record->steps += 1.0;
}

/* Motion to the end of the modes, at most over `reach`: its length, -1 if it cannot be computed. Every step is watched: of
 * fixed length the only one, under error control each that is accepted. For a second look, fixed steps that begin or end
 * with an event are halved: ticks of half the length would not test a motion that begins and ends within them, as the
 * contact with a stiff stop does.
 */
static double advance_segment(const scene_t* scene, const real* x, segment_t* segment, double reach, real* after,
                              int* event_free) {
  LOCAL(piece_t, own, piece_of, PIECE);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL(guard_values_t, guards, guard_values_of, GUARD_VALUES);
  double ground[NC + 1];
  search_t search = {scene, own, segment, ground};
  piece_t* piece = &search.piece;
  control_t* control = segment->control;
  find_geometry(scene, x, segment, &geometry);
  for (int k = 0; k < NC; ++k) ground[k] = fmin(geometry.place[3 * k], 0.0);
  copy(piece->begin, x, NX);
  begin_piece(scene, segment, piece);
  *event_free = 0;
  substeps_t at = first_substep(reach, scene->adaptive ? control->step : reach);
  for (long long k = 0; k < MOST_STEPS; ++k) {
    real error[2];
    int last = 1;
    error[0] = error[1] = 0.0;
    segment->memory->work += scene->step_cost;
    const double h = scene->adaptive ? next_length(&at, reach) : reach;
    const int reached = make_step(scene, segment, h, piece, error);
    if (scene->adaptive) {
      ++control->attempts;
      const enum outcome outcome = control_step(scene, &at, reach, error[0] / control->tolerance, reached);
      if (outcome == STEP_TOO_SMALL) break;
      if (outcome == REJECTED) continue;
      last = outcome == ENDED;
    }
    const double known = find_violation(scene, &search, h, reached, &guards);
    *event_free = known == 0.0;
    const double length = *event_free ? h : end_at_event(scene, &search, known, &guards, error);
    if (length < 0.0) return -1.0;
    if (scene->adaptive) {
      if (!*event_free && !is_accurate_cut(scene, &at, reach, length, error[0] / control->tolerance)) continue;
      control->error += error[1];
      control->step = at.step;
    }
    piece->from += length;
    record_step(segment, length);
    copy(piece->begin, piece->end, NX);
    if (last || !*event_free) {
      copy(after, piece->end, NX);
      return last && *event_free ? reach : piece->from;
    }
    begin_piece(scene, segment, piece);
  }
  /* The direction of a contact is undefined as it comes to rest: error control follows it as far as possible. */
  *event_free = 0;
  copy(after, piece->begin, NX);
  return piece->from > 0.0 ? piece->from : -1.0;
}

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
  const prediction_t* known = segment->predicted;
  if (NC && is_predicted(scene, segment) && known->closes && same(x, known->after, 2 * NU)
      && same(anchor, known->anchor, 2 * NC)) {
    copy(after, known->closed, 2 * NU);
    return;
  }
  CALL(scene->contact_close, (x, segment->p.tunable, anchor), (after));
}

/* Project positions and velocities onto the closed contacts, and onto the anchors of sticking ones. */
static void close_contacts(const scene_t* scene, real* x, const segment_t* segment, const real* anchor) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed != 0.0;
  if (!any) return;
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
  LOCAL(modes_t, modes, modes_of, P_LENGTH);
  segment_t resting = with_modes(scene, segment, &modes);
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

/* Next mode of contacts whose mode has just ended: lift off, or slip; and whether a set that holds together has. */
static void find_ended_modes(const scene_t* scene, const real* x, segment_t* segment, int event_free) {
  segment->yields = 0;
  for (int k = 0; k < NC; ++k) segment->contact[k].ended = STICKS;
  if (event_free || !(NC || scene->constrained)) return;
  LOCAL(loads_t, found, loads_of, LOADS);
  LOCAL(indeterminate_t, together, indeterminate_of, INDETERMINATE);
  clear(together.set, PARTS);
  find_loads(scene, x, segment, &found);
  if (scene->indeterminate) {
    segment->yields = 1; /* an evaluation at the limit */
    find_sets_held(scene, x, segment, &found, &together);
    int any = 0;
    for (int i = 0; i < PARTS; ++i)
      any |= together.set[i] != 0.0 && set_excess(segment, &together, (int)together.set[i]) > 0.0;
    segment->yields = any;
  }
  for (int k = 0; k < NC; ++k) {
    const real* r = found.force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    contact_t* contact = segment->contact + k;
    if (mode->closed == 0.0 || together.set[NU + k] != 0.0) continue;
    const double size = hypot(r[1], r[2]);
    if (r[0] <= 0.0) contact->ended = APART;
    else if (mode->sticks != 0.0 && size >= stick_limit(scene, segment, k) * r[0] && scene->holding[k] > 0.0) {
      contact->ended = SLIDES;
      for (int i = 0; i < 2; ++i) contact->slips[i] = -r[1 + i] / size;
    }
  }
}

/* Set joints that have just reached zero speed at rest: 0 if one was still fast, since the motion was not continuous. */
static int stop_joints(const scene_t* scene, real* x, const segment_t* segment) {
  const double fastest = largest_of(x + NU, NU);
  for (int i = 0; i < ND; ++i)
    if (may_stick(scene, i) && x[NU + i] * segment->p.direction[i] <= 0.0) {
      if (fabs(x[NU + i]) > SUDDEN_STOP * (1.0 + fastest)) return 0;
      x[NU + i] = 0.0;
    }
  return 1;
}

/* Move joints that are beyond a rigid stop by rounding to the stop. */
static void stop_at_limits(const scene_t* scene, real* x) {
  for (int i = 0; scene->rigid && i < NU; ++i) {
    if (x[i] < scene->rigid_stop[0][i]) x[i] = scene->rigid_stop[0][i];
    if (x[i] > scene->rigid_stop[1][i]) x[i] = scene->rigid_stop[1][i];
  }
}

/* Rank of a positive semidefinite matrix whose rows may be of very different size, by elimination with diagonal pivots. */
static int rank_of(const scene_t* scene, real* W) {
  double trace = 0.0, root[MC + 1];
  int count = 0;
  for (int i = 0; i < MC; ++i) trace += AT(W, MC, i, i);
  for (int i = 0; i < MC; ++i) root[i] = AT(W, MC, i, i) > IMMOBILE * trace ? 1.0 / sqrt(AT(W, MC, i, i)) : 0.0;
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) AT(W, MC, i, j) *= root[i] * root[j];
  for (; count < MC; ++count) {
    int k = 0;
    real row[MC + 1];
    for (int i = 1; i < MC; ++i)
      if (AT(W, MC, i, i) > AT(W, MC, k, k)) k = i;
    const real largest = AT(W, MC, k, k);
    if (!(largest > INDEPENDENT)) break;
    for (int i = 0; i < MC; ++i) row[i] = AT(W, MC, i, k);
    for (int i = 0; i < MC; ++i)
      for (int j = 0; j < MC; ++j) AT(W, MC, i, j) -= row[i] * row[j] / largest;
  }
  return count;
}

/* Number of degrees of freedom of sliding joints that the bilateral constraints remove. */
static int find_bilateral_rank(const scene_t* scene, const real* x, const segment_t* segment) {
  real rank = 0.0;
  CALL(scene->bilateral, (x, segment->u, segment->p.tunable), (&rank, 0));
  return (int)(rank + 0.5);
}

/* Whether friction, constraints and contacts leave no degree of freedom. */
static int is_held(const scene_t* scene, const real* x, const segment_t* segment) {
  if (largest_of(x + NU, NU) > REST_SPEED) return 0;
  LOCAL(inertia_t, inertia, inertia_of, INERTIA);
  int free = NU;
  for (int i = 0; i < ND; ++i) free -= segment->p.direction[i] == 0.0;
  if (scene->constrained) free -= find_bilateral_rank(scene, x, segment);
  if (free > MC) return 0;
  find_inertia(scene, x, segment, &inertia);
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) {
      const contact_mode_t *a = segment->p.contact + i / 3, *b = segment->p.contact + j / 3;
      AT(inertia.W, MC, i, j) *= a->closed * b->closed * (i % 3 ? a->sticks : 1.0) * (j % 3 ? b->sticks : 1.0);
    }
  return rank_of(scene, inertia.W) >= free;
}

/* Rate at which friction rotates the velocity of each sliding contact towards its direction; 0 if none slides. */
static int find_rates(const scene_t* scene, const real* x, const segment_t* segment, loads_t* found, geometry_t* geometry,
                      double* rate) {
  LOCAL(inertia_t, inertia, inertia_of, INERTIA);
  int any = 0;
  for (int k = 0; k < NC; ++k) {
    rate[k] = 0.0;
    any |= scene->friction[k] > 0.0 && is_sliding(segment->p.contact + k);
  }
  if (!any) return 0;
  find_loads(scene, x, segment, found);
  find_geometry(scene, x, segment, geometry);
  find_inertia(scene, x, segment, &inertia);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (!(scene->friction[k] > 0.0 && is_sliding(mode))) continue;
    const double a = -mode->along[1], b = mode->along[0], size = hypot(geometry->speed[n + 1], geometry->speed[n + 2]);
    double mobility = a * a * AT(inertia.W, MC, n + 1, n + 1) + b * b * AT(inertia.W, MC, n + 2, n + 2);
    mobility += 2.0 * a * b * AT(inertia.W, MC, n + 1, n + 2);
    rate[k] = scene->friction[k] * found->force[n] * mobility / fmax(size, scene->slowest);
  }
  return 1;
}

/* Find how each contact turns at the beginning of a segment, unless that is known. */
static void find_turning(const scene_t* scene, const real* x, segment_t* segment) {
  if (segment->turns || !NC) return;
  double rate[NC + 1];
  LOCAL(loads_t, found, loads_of, LOADS);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  segment->turns = 1;
  for (int k = 0; k < NC; ++k) segment->turning[k].rate = 0.0;
  if (!find_rates(scene, x, segment, &found, &geometry, rate)) return;
  for (int k = 0; k < NC; ++k) {
    const real *s = geometry.speed + 3 * k + 1, *a = found.rate + 3 * k + 1, *along = segment->p.contact[k].along;
    const double ahead = along[0] * a[0] + along[1] * a[1], across = fabs(along[0] * a[1] - along[1] * a[0]);
    turning_t* of = segment->turning + k;
    if (!(rate[k] > 0.0)) continue;
    of->slows = fmax(-ahead, 0.0) / fmax(hypot(s[0], s[1]), scene->slowest);
    of->rate = rate[k] + of->slows;
    of->drift = across / rate[k];
    of->turn = across;
  }
}

/* Contacts that are treated as at rest though they creep: 1 if there are any.
 *
 * Friction rotates the velocity of a contact towards its direction at the rate mu lambda w / s, with w the transverse
 * acceleration per force and s its speed. Of one that speeds up this direction is that in which it would start from rest;
 * where an explicit method could not keep up, a contact that has reached it is given it, and in a time-stepped tick any.
 */
static int find_slow(const scene_t* scene, const real* x, segment_t* segment, double tick) {
  int any = 0;
  find_turning(scene, x, segment);
  for (int k = 0; k < NC; ++k) {
    const turning_t* of = segment->turning + k;
    const int settled = of->slows == 0.0 && of->drift <= DRIFT(segment);
    segment->contact[k].slow = of->rate > MOST_PARTS / tick && (settled || segment->step > 0.0);
    any |= segment->contact[k].slow != 0.0;
  }
  return any;
}

/* Longest segment over which sliding can be followed: with fixed steps, a part of the time in which friction turns a contact
 * that a method of order 4 resolves. A contact that moves on a straight line keeps its direction where this is shorter than
 * a part of the tick.
 */
static double find_reach(const scene_t* scene, const real* x, segment_t* segment, double tick) {
  double reach = tick;
  find_turning(scene, x, segment);
  for (int k = 0; k < NC; ++k) {
    const turning_t* of = segment->turning + k;
    const double part = tick / MOST_PARTS, least = of->slows * part > 1.0 ? RESTING_DRIFT * of->slows : DRIFT(segment) / part;
    double length = 1.0 / of->rate;
    if (!(of->rate > 0.0)) continue;
    if (of->turn <= least && length < part) segment->p.contact[k].fixed = 1.0;
    if (segment->p.contact[k].fixed != 0.0) length = fmax(length, part);
    else if (!scene->adaptive) length *= fmin(1.0, pow(120.0 * TURN_ERROR / of->drift, 0.2));
    reach = fmin(reach, length);
  }
  return reach;
}

/* Stop slow contacts that move against the direction in which they would start. */
static void align(const scene_t* scene, real* x, const segment_t* segment) {
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  real anchor[2 * NC + 1];
  LOCAL(modes_t, modes, modes_of, P_LENGTH);
  segment_t stopped = with_modes(scene, segment, &modes);
  int any = 0;
  find_geometry(scene, x, segment, &geometry);
  find_anchors(scene, &geometry, anchor);
  for (int k = 0; k < NC; ++k) {
    const real* s = geometry.speed + 3 * k + 1;
    contact_mode_t* mode = stopped.p.contact + k;
    if (segment->contact[k].slow == 0.0 || mode->closed == 0.0 || mode->along[0] * s[0] + mode->along[1] * s[1] > 0.0)
      continue;
    mode->sticks = 1.0;
    any = 1;
  }
  if (any) close_contacts(scene, x, &stopped, anchor);
}
