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
#define RESTING_DRIFT (0.5 * SLOWEST) /* speed of a contact across its direction when it comes to rest, which is rest ... */
/* ... and while it slides, that need not be followed */
#define DRIFT(segment) (ADAPTIVE ? 10.0 * (segment)->control->tolerance : TURN_ERROR)
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

/* A step of the method in a segment, with its continuous output; where the method has a stage at the end, loads there. */
__extension__ typedef struct {
  real begin[NX], end[NX];
  dense_output_t inside;
  loads_t near; /* its load and force alone, ... */
  int nears;    /* ... if this is set */
  double from; /* its beginning since that of the segment */
  double length;
} piece_t;

/* The slope at the beginning of a piece, with which its steps begin; where nothing is held they find it themselves. */
static void begin_piece(const segment_t* segment, piece_t* piece) {
  if (MOVING && all_moves(segment->p.direction)) return;
  find_slope(piece->begin, segment, piece->inside.slope[0]);
}

/* Make a step of length h from the beginning of a piece: 1 if every number stayed finite. `error` receives the scaled error
 * and that of q, with an estimate. The step may be predicted.
 */
static int make_step(const segment_t* segment, double h, piece_t* piece, real* error) {
  const prediction_t* known = segment->predicted;
  const real length = h;
  WORKSPACE;
  piece->length = h;
  if (is_predicted(segment) && h == known->length && same(piece->begin, known->x, NX)) {
    memcpy(piece->end, known->after, sizeof known->after);
    memcpy(&piece->inside, &known->inside, sizeof known->inside);
    memcpy(piece->near.load, known->near, sizeof known->near);
    piece->nears = known->nears != 0;
    return within_reach(piece->end);
  }
  real** more = res;
  arg[0] = piece->begin;
  arg[1] = segment->u;
  arg[2] = (const real*)&segment->p;
  arg[3] = &length;
  *more++ = piece->end;
  if (ADAPTIVE) {
    *more++ = error;
    *more++ = error + 1;
  }
  piece->nears = 0;
  if (MOVING && all_moves(segment->p.direction)) {
    *more++ = piece->inside.slope[0];
    *more++ = piece->inside.slope[1];
    *more = piece->inside.middle;
    (ADAPTIVE ? moving_attempt : moving_step)(arg, res, iw, w, 0);
    return within_reach(piece->end);
  }
  arg[4] = piece->inside.slope[0];
  *more++ = piece->inside.slope[1];
  *more++ = piece->inside.middle;
  if (NEAR_LOADS) {
    *more++ = piece->near.load;
    *more = piece->near.force;
    piece->nears = STEADY;
  }
  (ADAPTIVE ? attempt : step)(arg, res, iw, w, 0);
  return within_reach(piece->end);
}

/* The state at a fraction of a piece: the polynomial of degree 4 through its ends, their slopes and the middle. */
static void state_inside(const piece_t* piece, double part, real* x) {
  const double h = piece->length, rest = 1.0 - part, a = rest * rest * (1.0 + 2.0 * part), bump = part * part * rest * rest;
  for (int i = 0; i < NX; ++i) {
    const double x0 = piece->begin[i], x1 = piece->end[i], f0 = piece->inside.slope[0][i], f1 = piece->inside.slope[1][i];
    const double bend = piece->inside.middle[i] - 0.5 * (x0 + x1) - 0.125 * h * (f0 - f1);
    x[i] = a * x0 + (1.0 - a) * x1 + h * part * rest * (rest * f0 - part * f1) + 16.0 * bump * bend;
  }
}

/* Whether a contact is closed or a joint sticks. */
static int anything_held(const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed != 0.0;
  for (int i = 0; i < ND; ++i) any |= segment->p.direction[i] == 0.0;
  return any;
}

#define MOST_STEPS (ADAPTIVE ? MOST_SUBSTEPS : 1)

/* Event functions, which must not be positive: of contacts gaps, or normal and tangential forces; of joints friction, and
 * both stops; of the sets that hold together the largest excess, in place of those of their parts. Each is smooth in time
 * while the modes last.
 */
__extension__ typedef struct {
  double contact[2 * NC], joint[ND], stop[2 * NU], pressed[2 * NQ], switched[NK], together;
} guard_values_t;
#define GUARDS ((int)(sizeof(guard_values_t) / sizeof(double)))
static void fill(guard_values_t* guards, double value) {
  for (int i = 0; i < GUARDS; ++i) ((double*)guards)[i] = value;
}
static double worst_of(const guard_values_t* guards) { return largest_among((const double*)guards, GUARDS); }

/* Positive where a joint is beyond a rigid stop, meets a compliant one or separates from it, after a motion of length t. */
static void evaluate_stop_guards(const real* x, const segment_t* segment, double t, guard_values_t* guards) {
  double met[2][NU], push[2][NU];
  for (int i = 0; RIGID && i < NU; ++i) {
    if (segment->p.direction[i] == 0.0) continue;
    const double room = SINKING * t + GAP_ROUNDING * (1.0 + fabs(x[i]));
    guards->stop[2 * i] = rigid_stop[0][i] - x[i] - room;
    guards->stop[2 * i + 1] = x[i] - rigid_stop[1][i] - room;
  }
  if (NQ) find_pressures(x, met, push);
  for (int i = 0; i < NQ; ++i)
    for (int side = 0; side < 2; ++side)
      guards->pressed[2 * i + side] = segment->p.pressed[i] == (side ? 1.0 : -1.0) ? -push[side][i] : met[side][i];
}

/* Speed against its direction that a sliding joint may have by rounding. */
static double turning_rounding(const real* x) { return TURNING_BACK * (1.0 + largest_of(x + NU, NU)); }

/* Replace the guards of parts that hold together by that of their sets, where reactions of the least norm are beyond. */
static void limit_indeterminate(const real* x, const segment_t* segment, const loads_t* found, guard_values_t* guards) {
  indeterminate_t together;
  if (!anything_beyond(x, segment, found)) return;
  find_sets_held(x, segment, found, &together);
  for (int i = 0; i < ND; ++i)
    if (together.set[i]) guards->joint[i] = -INFINITY;
  for (int k = 0; k < NC; ++k) {
    if (!together.set[NU + k]) continue;
    guards->contact[2 * k] = -INFINITY;
    if (segment->p.contact[k].sticks != 0.0) guards->contact[2 * k + 1] = -INFINITY;
  }
  for (int i = 0; i < PARTS; ++i)
    if (together.set[i]) guards->together = fmax(guards->together, set_excess(segment, &together, together.set[i]));
}

/* Whether a contact is apart or slides: its place or speed may end its mode. */
static int any_travels(const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed == 0.0 || segment->p.contact[k].sticks == 0.0;
  return any;
}

/* Whether loads and forces are so far from their guards that those of a state close by are within them. */
static int is_far_from_limits(const segment_t* segment, const loads_t* near, const real* x) {
  double heaviest = 0.0;
  if (segment->yields) return 0;
  for (int k = 0; k < NC; ++k)
    if (segment->p.contact[k].closed != 0.0) heaviest = fmax(heaviest, near->force[3 * k]);
  for (int k = 0; k < NC; ++k) {
    const real* r = near->force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) continue;
    if (!(r[0] > 2.0 * NEAR * heaviest)) return 0;
    if (mode->sticks != 0.0 && !(hypot(r[1], r[2]) < (1.0 - 2.0 * NEAR) * stick_limit(segment, k) * r[0])) return 0;
  }
  for (int i = 0; i < ND; ++i)
    if (segment->p.direction[i] == 0.0 && (at_stop(x, i) || !(fabs(near->load[i]) < (1.0 - 2.0 * NEAR) * static_level[i])))
      return 0;
  return 1;
}

/* Positive where a contact or joint violates its mode after a motion of length t; returns the largest violation. `near`: the
 * loads at a state close by, which are taken if what is held is held firmly, or null. */
static double evaluate_guards(const real* x, const segment_t* segment, const double* ground, double t, const loads_t* near,
                              guard_values_t* guards) {
  const real *d = segment->p.direction, *v = x + NU;
  const double rounding = turning_rounding(x);
  geometry_t geometry;
  loads_t found;
  __extension__ real value[NK], size[NK];
  fill(guards, -INFINITY);
  if (any_travels(segment)) find_geometry(x, segment, &geometry);
  if (near && is_far_from_limits(segment, near, x)) found = *near;
  else if (anything_held(segment)) find_loads(x, segment, &found);
  for (int k = 0; k < NC; ++k) {
    const real *r = found.force + 3 * k, *s = geometry.speed + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) {
      guards->contact[2 * k] = ground[k] - geometry.place[3 * k] - SINKING * t - GAP_ROUNDING * geometry.size[k];
      continue;
    }
    guards->contact[2 * k] = -r[0];
    if (mode->sticks != 0.0) guards->contact[2 * k + 1] = hypot(r[1], r[2]) - stick_limit(segment, k) * r[0];
    else if (holding[k] > 0.0) guards->contact[2 * k + 1] = -(mode->along[0] * s[1] + mode->along[1] * s[2]) - rounding;
  }
  for (int i = 0; i < ND; ++i) {
    if (d[i] == 0.0) guards->joint[i] = joint_excess(x, &found, i);
    else if (may_stick(i)) guards->joint[i] = -v[i] * d[i] - rounding;
  }
  if (INDETERMINATE && anything_held(segment)) limit_indeterminate(x, segment, &found, guards);
  evaluate_stop_guards(x, segment, t, guards);
  find_switches(x, segment, value, size);
  for (int k = 0; k < NK; ++k)
    if (size[k] > 0.0) /* else nothing is compared, as the engagement of teeth within their backlash */
      guards->switched[k] = (segment->p.switches[k] != 0.0 ? -value[k] : value[k]) - SWITCH_ROUNDING * size[k];
  return worst_of(guards);
}

/* A piece of a motion in which events are searched. */
__extension__ typedef struct {
  piece_t piece;
  const segment_t* segment;
  double ground[NC]; /* gaps at the beginning of the segment that are negative by rounding */
} search_t;

/* Whether all modes are satisfied at a time in the piece, by a step of that length. */
static double excess_at(const search_t* search, double t, guard_values_t* guards) {
  piece_t part;
  real error[2];
  search->segment->memory->work += step_cost;
  memcpy(part.begin, search->piece.begin, sizeof part.begin);
  memcpy(part.inside.slope[0], search->piece.inside.slope[0], sizeof part.inside.slope[0]);
  memcpy(part.end, part.begin, sizeof part.end);
  if (t == 0.0 || make_step(search->segment, t, &part, error))
    return evaluate_guards(part.end, search->segment, search->ground, search->piece.from + t, 0, guards);
  fill(guards, INFINITY);
  return INFINITY;
}

static void guards_at(const void* asked, double t, double* guards) {
  excess_at((const search_t*)asked, t, (guard_values_t*)guards);
}

/* Bounds of a number of the state inside a piece. */
static void find_bounds(const piece_t* piece, int i, double* low, double* high) {
  bound_inside(piece->begin, piece->end, (const real*)&piece->inside, piece->length, i, low, high);
}

/* Whether the speed of a sliding joint may reach zero inside a piece, or a joint its stop. */
static int joint_may_cross(const piece_t* piece, const segment_t* segment, int i) {
  double low, high;
  if (ND && may_stick(i)) { /* if it does not turn, it meets a stop at most once */
    find_bounds(piece, NU + i, &low, &high);
    return segment->p.direction[i] > 0.0 ? low <= 0.0 : high >= 0.0;
  }
  find_bounds(piece, i, &low, &high);
  return low <= stop_place[0][i] || high >= stop_place[1][i];
}

/* Whether a contact may end or change its mode inside a piece that satisfies it at both ends. */
static int contact_may_cross(const segment_t* segment, const geometry_t* begin, const geometry_t* end, double h, int k) {
  const contact_mode_t* mode = segment->p.contact + k;
  const real *s0 = begin->speed + 3 * k, *s1 = end->speed + 3 * k;
  if (mode->closed == 0.0) {
    double low, high;
    bound_cubic(begin->place[3 * k], s0[0], end->place[3 * k], s1[0], h, &low, &high);
    return low <= NEAR * (high - low);
  }
  if (mode->sticks != 0.0 || !(holding[k] > 0.0)) return 0;
  const double ahead0 = mode->along[0] * s0[1] + mode->along[1] * s0[2],
               ahead1 = mode->along[0] * s1[1] + mode->along[1] * s1[2];
  return fmin(ahead0, ahead1) <= SLOWED * fmax(ahead0, ahead1);
}

/* Whether something that holds is close to its limit at the end of a piece, or loads vary within it; under error control,
 * where pieces are long, and with internal states, whether anything holds.
 */
static int load_may_cross(const piece_t* piece, const segment_t* segment, const guard_values_t* end) {
  if (!anything_held(segment)) return 0;
  if (ADAPTIVE) return 1;
  const real* inside = (const real*)&piece->inside;
  if (NX > 2 * NU || !varies_evenly(piece->begin, piece->end, inside, piece->length)) return 1;
  for (int k = 0; k < NC; ++k) {
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) continue;
    const double push = -end->contact[2 * k];
    for (int l = 0; l < NC; ++l)
      if (segment->p.contact[l].closed != 0.0 && push < -NEAR * end->contact[2 * l]) return 1;
    if (mode->sticks != 0.0 && holding[k] > 0.0 && end->contact[2 * k + 1] > -NEAR * stick_limit(segment, k) * push) return 1;
  }
  for (int i = 0; i < ND; ++i)
    if (segment->p.direction[i] == 0.0 && end->joint[i] > -NEAR * static_level[i]) return 1;
  return end->together > -NEAR;
}

/* Whether a drive or cord may switch inside a piece and back: whether it comes close, as the middle shows, or a wave passes. */
static int switch_may_cross(const piece_t* piece, const segment_t* segment, const guard_values_t* end) {
  __extension__ real x[NX], value[NK], size[NK], middle[NK];
  if (!NK) return 0;
  if (phase_of(piece->begin, piece->end) > 1.0) return 1;
  state_inside(piece, 0.5, x);
  find_switches(x, segment, middle, size);
  find_switches(piece->begin, segment, value, size);
  for (int k = 0; k < NK; ++k) {
    const double far = segment->p.switches[k] != 0.0 ? 1.0 : -1.0, a = far * value[k], b = far * middle[k],
                 c = -end->switched[k];
    if (fmin(fmin(a, b), c) <= 0.5 * (fmax(fmax(a, b), c) - fmin(fmin(a, b), c))) return 1;
  }
  return 0;
}

/* Whether a mode may end inside a piece that satisfies all of them at both ends. */
static int may_cross(const search_t* search, const guard_values_t* end) {
  const piece_t* piece = &search->piece;
  const segment_t* segment = search->segment;
  for (int i = 0; i < NU; ++i)
    if (!(ND && segment->p.direction[i] == 0.0) && joint_may_cross(piece, segment, i)) return 1;
  if (load_may_cross(piece, segment, end) || switch_may_cross(piece, segment, end)) return 1;
  if (any_travels(segment)) {
    geometry_t first, last;
    find_geometry(piece->begin, segment, &first);
    find_geometry(piece->end, segment, &last);
    for (int k = 0; k < NC; ++k)
      if (contact_may_cross(segment, &first, &last, piece->length, k)) return 1;
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
static double peak_of(const search_t* search, int guard, double* t, double* f, guard_values_t* guards) {
  double doubt = PEAK_DOUBT * (fabs(f[1] - f[0]) + fabs(f[1] - f[2]));
  for (int k = 0; k < PEAK_TRIALS; ++k, doubt *= PEAK_GAIN) {
    const double way = vertex_of(t, f), trial = t[1] + way;
    if (!(trial > t[0] && trial < t[2])) return 0.0;
    excess_at(search, trial, guards);
    const double value = ((const double*)guards)[guard];
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
static double find_crossing(const search_t* search, const guard_values_t* end, guard_values_t* guards) {
  const piece_t* piece = &search->piece;
  guard_values_t sample[3]; /* the last three */
  real x[NX];
  if (!may_cross(search, end)) return 0.0;
  const double phase = phase_of(piece->begin, piece->end), parts = GUARD_SAMPLES * (1.0 + floor(phase / SAMPLE_PHASE));
  const int samples = (int)fmin(parts, MOST_GUARD_SAMPLES);
  const double step = piece->length / samples;
  for (int k = 0; k <= samples; ++k) {
    guard_values_t* last = sample + k % 3;
    state_inside(piece, (double)k / samples, x);
    if (k == samples) *last = *end;
    else evaluate_guards(x, search->segment, search->ground, piece->from + k * step, 0, last);
    for (int guard = 0; k > 1 && guard < GUARDS; ++guard) {
      double t[3] = {(k - 2) * step, (k - 1) * step, k * step}, f[3];
      for (int i = 0; i < 3; ++i) f[i] = ((const double*)(sample + (k + 1 + i) % 3))[guard];
      const double way = vertex_of(t, f), bend = 2.0 * f[1] - f[0] - f[2];
      if (!(fmax(f[1], fmax(f[0], f[2])) + PEAK_MARGIN * bend > 0.0) || way != way) continue;
      const double found = peak_of(search, guard, t, f, guards);
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
static double find_next(const real* x, const segment_t* segment, const geometry_t* geometry) {
  double soonest = INFINITY;
  real slope[NX];
  loads_t found;
  int apart = 0;
  for (int k = 0; k < NC; ++k) apart |= segment->p.contact[k].closed == 0.0;
  if (apart) find_loads(x, segment, &found);
  find_slope(x, segment, slope);
  for (int i = 0; i < NU; ++i) {
    const double v = x[NU + i], a = slope[NU + i];
    if (may_stick(i) && v * a < 0.0) soonest = fmin(soonest, -v / a);
    if (!RIGID || segment->p.direction[i] == 0.0) continue;
    const double below = GAP_ROUNDING * (1.0 + fabs(x[i]));
    soonest =
        fmin(soonest, fmin(arrival(x[i] - rigid_stop[0][i] + below, -v, -a), arrival(rigid_stop[1][i] - x[i] + below, v, a)));
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
static double end_at_event(search_t* search, double known, guard_values_t* guards, real* error) {
  piece_t* piece = &search->piece;
  geometry_t geometry;
  guard_values_t early;
  double room[4 * GUARDS];
  find_geometry(piece->begin, search->segment, &geometry);
  for (double near = find_next(piece->begin, search->segment, &geometry); near < known; near *= SEARCH_FACTOR) {
    if (!(excess_at(search, near, &early) > 0.0)) continue;
    known = near;
    *guards = early;
  }
  for (int turn = 0; turn < EARLIER; ++turn) {
    const double length = first_positive(guards_at, search, GUARDS, known, (const double*)guards, VIOLATION_ROUNDING, room);
    if (!make_step(search->segment, length, piece, error)) return -1.0;
    evaluate_guards(piece->end, search->segment, search->ground, piece->from + length, 0, &early);
    known = find_crossing(search, &early, guards);
    if (known == 0.0) return length;
  }
  return piece->length;
}

/* A time in a piece of length h, whose end may be out of reach, at which a mode is violated; 0 if all are satisfied. */
static double find_violation(const search_t* search, double h, int reached, guard_values_t* guards) {
  const piece_t* piece = &search->piece;
  const loads_t* near = piece->nears ? &piece->near : 0;
  guard_values_t peak;
  if (!reached) fill(guards, INFINITY);
  if (!reached || evaluate_guards(piece->end, search->segment, search->ground, piece->from + h, near, guards) > 0.0) return h;
  const double known = find_crossing(search, guards, &peak);
  if (known > 0.0) *guards = peak;
  return known;
}

/* Whether an accepted attempt that an event cuts to `length` is accurate, with its error `size` then: an attempt that passes
 * over what happens close to the event may not notice it. If not, a shorter one is to be tried from the same beginning.
 */
static int is_accurate_cut(substeps_t* at, double h, double length, double size) {
  if (size <= 1.0 || length < 1e-12 * h) return 1;
  const double factor = 0.9 * pow(size, -1.0 / ORDER);
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
static double advance_segment(const real* x, segment_t* segment, double reach, real* after, int* event_free) {
  search_t search;
  piece_t* piece = &search.piece;
  control_t* control = segment->control;
  geometry_t geometry;
  search.segment = segment;
  piece->from = 0.0;
  find_geometry(x, segment, &geometry);
  for (int k = 0; k < NC; ++k) search.ground[k] = fmin(geometry.place[3 * k], 0.0);
  memcpy(piece->begin, x, sizeof piece->begin);
  begin_piece(segment, piece);
  *event_free = 0;
  substeps_t at = first_substep(reach, ADAPTIVE ? control->step : reach);
  for (long long k = 0; k < MOST_STEPS; ++k) {
    guard_values_t guards;
    real error[2];
    int last = 1;
    error[0] = error[1] = 0.0;
    segment->memory->work += step_cost;
    const double h = ADAPTIVE ? next_length(&at, reach) : reach;
    const int reached = make_step(segment, h, piece, error);
    if (ADAPTIVE) {
      ++control->attempts;
      const enum outcome outcome = control_step(&at, reach, error[0] / control->tolerance, reached);
      if (outcome == STEP_TOO_SMALL) break;
      if (outcome == REJECTED) continue;
      last = outcome == ENDED;
    }
    const double known = find_violation(&search, h, reached, &guards);
    *event_free = known == 0.0;
    const double length = *event_free ? h : end_at_event(&search, known, &guards, error);
    if (length < 0.0) return -1.0;
    if (ADAPTIVE) {
      if (!*event_free && !is_accurate_cut(&at, reach, length, error[0] / control->tolerance)) continue;
      control->error += error[1];
      control->step = at.step;
    }
    piece->from += length;
    record_step(segment, length);
    memcpy(piece->begin, piece->end, sizeof piece->begin);
    if (last || !*event_free) {
      memcpy(after, piece->end, sizeof piece->end);
      return last && *event_free ? reach : piece->from;
    }
    begin_piece(segment, piece);
  }
  /* The direction of a contact is undefined as it comes to rest: error control follows it as far as possible. */
  *event_free = 0;
  memcpy(after, piece->begin, sizeof piece->begin);
  return piece->from > 0.0 ? piece->from : -1.0;
}

/* Whether a closed contact has a gap or a velocity to be corrected. */
static int is_off(const real* x, const segment_t* segment, const geometry_t* geometry) {
  const double limit = speed_rounding(x) / 10.0;
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
static void find_closed(const real* x, const segment_t* segment, const real* anchor, real* after) {
  const prediction_t* known = segment->predicted;
  WORKSPACE;
  if (NC && is_predicted(segment) && known->closes && same(x, known->after, 2 * NU) && same(anchor, known->anchor, 2 * NC)) {
    memcpy(after, known->closed, sizeof known->closed);
    return;
  }
  arg[0] = x;
  arg[1] = (const real*)&segment->p;
  arg[2] = anchor;
  res[0] = after;
  contact_close(arg, res, iw, w, 0);
}

/* Project positions and velocities onto the closed contacts, and onto the anchors of sticking ones. */
static void close_contacts(real* x, const segment_t* segment, const real* anchor) {
  int any = 0;
  real after[2 * NU];
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed != 0.0;
  for (int turn = 0; any && turn < 2; ++turn) {
    find_closed(x, segment, anchor, after);
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
static void rest_touching(real* x, const segment_t* segment, const real* anchor) {
  const double rounding = speed_rounding(x);
  geometry_t geometry;
  segment_t resting = *segment;
  int any = 0;
  if (NC < 2) return;
  find_geometry(x, segment, &geometry);
  for (int k = 0; k < NC; ++k) {
    if (!segment->contact[k].touching) continue;
    any |= segment->p.contact[k].closed == 0.0 && geometry.speed[3 * k] < -rounding;
    resting.p.contact[k].closed = 1.0;
  }
  if (any) close_contacts(x, &resting, anchor);
}

/* Position of each point in its plane's tangents. */
static void find_anchors(const geometry_t* geometry, real* anchor) {
  for (int i = 0; i < 2 * NC; ++i) anchor[i] = geometry->place[3 * (i / 2) + 1 + i % 2];
}

/* Next mode of contacts whose mode has just ended: lift off, or slip; and whether a set that holds together has. */
static void find_ended_modes(const real* x, segment_t* segment, int event_free) {
  loads_t found;
  indeterminate_t together;
  for (int i = 0; i < NU + NC; ++i) together.set[i] = 0;
  segment->yields = 0;
  if ((NC || NB) && !event_free) find_loads(x, segment, &found);
  if (INDETERMINATE && !event_free) {
    segment->yields = 1; /* an evaluation at the limit */
    find_sets_held(x, segment, &found, &together);
    int any = 0;
    for (int i = 0; i < PARTS; ++i) any |= together.set[i] && set_excess(segment, &together, together.set[i]) > 0.0;
    segment->yields = any;
  }
  for (int k = 0; k < NC; ++k) {
    const real* r = found.force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    contact_t* contact = segment->contact + k;
    contact->ended = STICKS;
    if (event_free || mode->closed == 0.0 || together.set[NU + k]) continue;
    const double size = hypot(r[1], r[2]);
    if (r[0] <= 0.0) contact->ended = APART;
    else if (mode->sticks != 0.0 && size >= stick_limit(segment, k) * r[0] && holding[k] > 0.0) {
      contact->ended = SLIDES;
      for (int i = 0; i < 2; ++i) contact->slips[i] = -r[1 + i] / size;
    }
  }
}

/* Set joints that have just reached zero speed at rest: 0 if one was still fast, since the motion was not continuous. */
static int stop_joints(real* x, const segment_t* segment) {
  const double fastest = largest_of(x + NU, NU);
  for (int i = 0; i < ND; ++i)
    if (may_stick(i) && x[NU + i] * segment->p.direction[i] <= 0.0) {
      if (fabs(x[NU + i]) > SUDDEN_STOP * (1.0 + fastest)) return 0;
      x[NU + i] = 0.0;
    }
  return 1;
}

/* Move joints that are beyond a rigid stop by rounding to the stop. */
static void stop_at_limits(real* x) {
  for (int i = 0; RIGID && i < NU; ++i) {
    if (x[i] < rigid_stop[0][i]) x[i] = rigid_stop[0][i];
    if (x[i] > rigid_stop[1][i]) x[i] = rigid_stop[1][i];
  }
}

/* Rank of a positive semidefinite matrix whose rows may be of very different size, by elimination with diagonal pivots. */
static int rank_of(real* W) {
  __extension__ double trace = 0.0, root[MC];
  int count = 0;
  for (int i = 0; i < MC; ++i) trace += AT(W, MC, i, i);
  for (int i = 0; i < MC; ++i) root[i] = AT(W, MC, i, i) > IMMOBILE * trace ? 1.0 / sqrt(AT(W, MC, i, i)) : 0.0;
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) AT(W, MC, i, j) *= root[i] * root[j];
  for (; count < MC; ++count) {
    int k = 0;
    __extension__ real row[MC];
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
static int find_bilateral_rank(const real* x, const segment_t* segment) {
  real rank = 0.0;
  WORKSPACE;
  arg[0] = x;
  arg[1] = segment->u;
  arg[2] = (const real*)&segment->p;
  res[0] = &rank;
  res[1] = 0;
  bilateral(arg, res, iw, w, 0);
  return (int)(rank + 0.5);
}

/* Whether friction, constraints and contacts leave no degree of freedom. */
static int is_held(const real* x, const segment_t* segment) {
  if (largest_of(x + NU, NU) > REST_SPEED) return 0;
  inertia_t inertia;
  int free = NU;
  for (int i = 0; i < ND; ++i) free -= segment->p.direction[i] == 0.0;
  if (NB) free -= find_bilateral_rank(x, segment);
  if (free > MC) return 0;
  find_inertia(x, segment, &inertia);
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) {
      const contact_mode_t *a = segment->p.contact + i / 3, *b = segment->p.contact + j / 3;
      AT(inertia.W, MC, i, j) *= a->closed * b->closed * (i % 3 ? a->sticks : 1.0) * (j % 3 ? b->sticks : 1.0);
    }
  return rank_of(inertia.W) >= free;
}

/* Rate at which friction rotates the velocity of each sliding contact towards its direction; 0 if none slides. */
static int find_rates(const real* x, const segment_t* segment, loads_t* found, geometry_t* geometry, double* rate) {
  inertia_t inertia;
  int any = 0;
  for (int k = 0; k < NC; ++k) {
    rate[k] = 0.0;
    any |= friction[k] > 0.0 && is_sliding(segment->p.contact + k);
  }
  if (!any) return 0;
  find_loads(x, segment, found);
  find_geometry(x, segment, geometry);
  find_inertia(x, segment, &inertia);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (!(friction[k] > 0.0 && is_sliding(mode))) continue;
    const double a = -mode->along[1], b = mode->along[0], size = hypot(geometry->speed[n + 1], geometry->speed[n + 2]);
    double mobility = a * a * AT(inertia.W, MC, n + 1, n + 1) + b * b * AT(inertia.W, MC, n + 2, n + 2);
    mobility += 2.0 * a * b * AT(inertia.W, MC, n + 1, n + 2);
    rate[k] = friction[k] * found->force[n] * mobility / fmax(size, SLOWEST);
  }
  return 1;
}

/* Find how each contact turns at the beginning of a segment, unless that is known. */
static void find_turning(const real* x, segment_t* segment) {
  __extension__ double rate[NC];
  loads_t found;
  geometry_t geometry;
  if (segment->turns) return;
  segment->turns = 1;
  for (int k = 0; k < NC; ++k) segment->turning[k].rate = 0.0;
  if (!find_rates(x, segment, &found, &geometry, rate)) return;
  for (int k = 0; k < NC; ++k) {
    const real *s = geometry.speed + 3 * k + 1, *a = found.rate + 3 * k + 1, *along = segment->p.contact[k].along;
    const double ahead = along[0] * a[0] + along[1] * a[1], across = fabs(along[0] * a[1] - along[1] * a[0]);
    turning_t* of = segment->turning + k;
    if (!(rate[k] > 0.0)) continue;
    of->slows = fmax(-ahead, 0.0) / fmax(hypot(s[0], s[1]), SLOWEST);
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
static int find_slow(const real* x, segment_t* segment, double tick) {
  int any = 0;
  find_turning(x, segment);
  for (int k = 0; k < NC; ++k) {
    const turning_t* of = segment->turning + k;
    const int settled = of->slows == 0.0 && of->drift <= DRIFT(segment);
    segment->contact[k].slow = of->rate > MOST_PARTS / tick && (settled || segment->step > 0.0);
    any |= segment->contact[k].slow;
  }
  return any;
}

/* Longest segment over which sliding can be followed: with fixed steps, a part of the time in which friction turns a contact
 * that a method of order 4 resolves. A contact that moves on a straight line keeps its direction where this is shorter than
 * a part of the tick.
 */
static double find_reach(const real* x, segment_t* segment, double tick) {
  double reach = tick;
  find_turning(x, segment);
  for (int k = 0; k < NC; ++k) {
    const turning_t* of = segment->turning + k;
    const double part = tick / MOST_PARTS, least = of->slows * part > 1.0 ? RESTING_DRIFT * of->slows : DRIFT(segment) / part;
    double length = 1.0 / of->rate;
    if (!(of->rate > 0.0)) continue;
    if (of->turn <= least && length < part) segment->p.contact[k].fixed = 1.0;
    if (segment->p.contact[k].fixed != 0.0) length = fmax(length, part);
    else if (!ADAPTIVE) length *= fmin(1.0, pow(120.0 * TURN_ERROR / of->drift, 0.2));
    reach = fmin(reach, length);
  }
  return reach;
}

/* Stop slow contacts that move against the direction in which they would start. */
static void align(real* x, const segment_t* segment) {
  geometry_t geometry;
  __extension__ real anchor[2 * NC];
  segment_t stopped = *segment;
  int any = 0;
  find_geometry(x, segment, &geometry);
  find_anchors(&geometry, anchor);
  for (int k = 0; k < NC; ++k) {
    const real* s = geometry.speed + 3 * k + 1;
    contact_mode_t* mode = stopped.p.contact + k;
    if (!segment->contact[k].slow || mode->closed == 0.0 || mode->along[0] * s[0] + mode->along[1] * s[1] > 0.0) continue;
    mode->sticks = 1.0;
    any = 1;
  }
  if (any) close_contacts(x, &stopped, anchor);
}
