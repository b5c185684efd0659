/* SPDX-License-Identifier: Apache-2.0
 *
 * Selection of the modes of joints with dry friction, joints at stops, and contacts.
 *
 * A joint at rest sticks while its holding torque is within the static level; otherwise it slides in the direction of the
 * torque on it (Glocker, Set-Valued Force Laws, 2001). A joint at rest at a rigid stop is also held, by a reaction that only
 * pushes. A contact touches where its gap is zero to rounding. Which of them stick, slide, transmit forces or separate is a
 * complementarity problem in the metric of M, solved by pivoting: the entry with the largest violation changes its mode until
 * there is none. If that cycles, the first violation is chosen for joints alone, a rule that cannot cycle (Murty, Linear
 * Complementarity, Linear and Nonlinear Programming, 1988, section 4.1), and contacts are solved together by
 * several_contacts.h.
 *
 * Where statics does not determine the reactions of what is held, the parts hold together: see indeterminate.h. A set that
 * does not hold is released in the motion in which it gives way, and pivoting goes on from there.
 */

#pragma once
#include "modes/initial_modes.h"

#define ACCELERATION_TOLERANCE 1e-9 /* acceleration in the wrong direction, relative to the largest */
#define COMBINATION_LIMIT 729       /* combinations of modes of joints that are tried as a last resort */
#define LEAST_NORM_DAMPING 1e-5     /* of the iteration to forces of least norm, relative to the mobility */
#define LEAST_NORM_STEPS 6          /* of the iteration to forces of least norm */
#define PIVOTS (NC ? 40 * (NC + NU) : 3 * NU + (1 << (NU < 12 ? NU : 12)))
#define WORST_FIRST (NC ? PIVOTS : 3 * NU) /* pivots before the first violation is chosen */

/* Excess of the torque on a joint at rest over the capacity of friction and its stop: not positive if they hold it. */
static double joint_excess(const scene_t* scene, const real* x, const loads_t* loads, int joint) {
  const double load = loads->load[joint];
  const int side = at_stop(scene, x, joint);
  return (side ? -side * load : fabs(load)) - scene->static_level[joint];
}

/* Violation of the limits of its force by a contact: not positive if satisfied. */
static double force_excess(const scene_t* scene, const segment_t* segment, const loads_t* loads, int k) {
  const real* r = loads->force + 3 * k;
  const contact_mode_t* mode = segment->p.contact + k;
  if (mode->closed == 0.0) return 0.0;
  if (r[0] < 0.0) return -r[0];
  return mode->sticks != 0.0 ? hypot(r[1], r[2]) - stick_limit(scene, segment, k) * r[0] : 0.0;
}

/* Violation of the laws by the acceleration of a contact that opens, or starts to slide. */
static double rate_excess(const segment_t* segment, const loads_t* loads, int k, double fastest) {
  const real* a = loads->rate + 3 * k;
  const contact_mode_t* mode = segment->p.contact + k;
  if (mode->closed == 0.0) return segment->contact[k].is_touching != 0.0 ? -a[0] / fastest - ACCELERATION_TOLERANCE : 0.0;
  if (mode->sticks != 0.0 || segment->contact[k].was_sliding != 0.0) return 0.0;
  const double ahead = mode->along[0] * a[1] + mode->along[1] * a[2], astray = mode->along[0] * a[2] - mode->along[1] * a[1];
  return fmax(-ahead, fabs(astray)) / fastest - ACCELERATION_TOLERANCE;
}

/* Whether reactions of the least norm are beyond a limit. */
static int anything_beyond(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* loads) {
  int any = segment->is_yielding;
  for (int k = 0; k < NC; ++k) any |= force_excess(scene, segment, loads, k) > 0.0;
  for (int i = 0; i < ND; ++i) any |= segment->p.direction[i] == 0.0 && joint_excess(scene, x, loads, i) > 0.0;
  return any;
}

/* The entry with the largest, or just the first, violation: a contact, or NC plus a joint; -1 if there is none. `set`
 * receives the number of the set to which the violated limit belongs, or 0. */
static int find_infeasible(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* loads, int first,
                           indeterminate_t* sets, int* set) {
  const double heaviest = 1.0 + max_abs(loads->force, MC), fastest = 1.0 + max_abs(loads->rate, MC);
  const real* d = segment->p.direction;
  double largest_excess = 0.0;
  int worst = -1;
  for (int i = 0; i < NU + NC; ++i) sets->set[i] = 0;
  if (scene->indeterminate && anything_beyond(scene, x, segment, loads)) find_sets_held(scene, x, segment, loads, sets);
  for (int k = 0; k < NC; ++k) {
    const int set_number = (int)sets->set[NU + k];
    const double beyond =
        set_number ? set_excess(segment, sets, set_number) : force_excess(scene, segment, loads, k) / heaviest;
    const double excess = beyond > 0.0 ? beyond : rate_excess(segment, loads, k, fastest);
    if (excess > largest_excess) {
      largest_excess = excess;
      worst = k;
      *set = beyond > 0.0 ? set_number : 0;
    }
  }
  const real* a = loads->slope + NU;
  const double quickest = 1.0 + max_abs(a, NU), level = max_abs(scene->static_level, NU), highest = level > 0.0 ? level : 1.0;
  for (int i = 0; i < ND; ++i) {
    if (!rests(scene, x, i)) continue;
    const int set_number = (int)sets->set[i];
    const double excess = set_number    ? set_excess(segment, sets, set_number)
                          : d[i] == 0.0 ? joint_excess(scene, x, loads, i) / highest
                                        : -d[i] * a[i] / quickest - ACCELERATION_TOLERANCE;
    if (excess > largest_excess) {
      largest_excess = excess;
      worst = NC + i;
      *set = set_number;
      if (first) return worst;
    }
  }
  return worst;
}

/* Give a contact the mode that solves its problem. */
static void put_mode(contact_mode_t* mode, const contact_solution_t* answer) {
  mode->closed = answer->state == SLIDES || answer->state == STICKS;
  mode->sticks = answer->state == STICKS;
  for (int i = 0; i < 2; ++i) mode->along[i] = answer->direction[i];
}

/* Let a contact on the boundary of its cone slide, against the force on it. */
static void let_slip(contact_solution_t* answer, const double* force) {
  const double size = hypot(force[1], force[2]);
  answer->state = SLIDES;
  for (int i = 0; i < 2; ++i) answer->direction[i] = -force[1 + i] / size;
}

/* Change the entry to a mode that satisfies the laws while the others are unchanged: 0 if none does. */
static int pivot(const scene_t* scene, const real* x, segment_t* segment, const loads_t* loads, int entry) {
  if (entry >= NC) {
    const int joint = entry - NC,
              may_reverse = scene->constrained && segment->has_tried_reverse[joint] == 0.0 && !at_stop(scene, x, joint);
    real* d = segment->p.direction + joint;
    segment->has_tried_reverse[joint] = *d != 0.0 && may_reverse;
    *d = *d == 0.0 ? sign_of(loads->load[joint]) : may_reverse ? -*d : 0.0;
    return 1;
  }
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  double block[3][3], c[3];
  const real* r = loads->force + 3 * entry;
  const contact_t* contact = segment->contact + entry;
  contact_mode_t* mode = segment->p.contact + entry;
  find_mobility(scene, x, segment, &mobility);
  own_block(scene, mobility.W, entry, block);
  for (int i = 0; i < 3; ++i)
    c[i] = loads->rate[3 * entry + i] - (block[i][0] * r[0] + block[i][1] * r[1] + block[i][2] * r[2]);
  contact_solution_t answer = solve_contact(block, c, scene->friction[entry], stick_limit(scene, segment, entry),
                                            contact->was_sliding != 0.0 ? contact->sliding_direction : 0);
  if (answer.state == UNSOLVABLE) return 0;
  if (answer.state == STICKS && mode->closed != 0.0 && mode->sticks != 0.0) let_slip(&answer, r); /* on the boundary */
  put_mode(mode, &answer);
  return 1;
}

/* Forces of all contacts together. Of redundant ones those of the least norm, as the generated functions find them, by the
 * same iteration with larger steps: the directions in which contacts start to slide depend on each one's share of the load.
 */
static int solve_of_least_norm(const scene_t* scene, cones_t* cones, const mobility_t* mobility, contact_solution_t* answers) {
  double W[MC * MC + 1], c[MC + 1], damping[MC + 1], trace = 0.0;
  int solved = 1;
  for (int i = 0; i < MC; ++i) trace += AT(mobility->W, MC, i, i);
  for (int i = 0; i < MC * MC; ++i) W[i] = mobility->W[i];
  for (int i = 0; i < MC; ++i) {
    damping[i] = LEAST_NORM_DAMPING * scale_of(AT(W, MC, i, i), trace);
    AT(W, MC, i, i) += damping[i];
    c[i] = mobility->free[i];
  }
  cones->W = W;
  cones->c = c;
  for (int step = 0; step < LEAST_NORM_STEPS && solved; ++step) {
    solved = solve_contacts(scene, cones, answers);
    for (int i = 0; i < MC; ++i) c[i] = mobility->free[i] - damping[i] * answers[i / 3].force[i % 3];
  }
  cones->W = mobility->W;
  cones->c = mobility->free;
  return solved || solve_contacts(scene, cones, answers);
}

/* Solve all contacts together, where pivoting cycles, with or without their static friction: without, there is a solution,
 * which the law with it allows. The modes are kept if none is found. */
static void solve_all_contacts(const scene_t* scene, const real* x, segment_t* segment, int with_static) {
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  double limit[NC + 1];
  contact_solution_t answers[NC + 1];
  LOCAL(cones_t, cones, cones_of, CONES);
  cones.friction = scene->friction;
  cones.static_friction = limit;
  find_mobility(scene, x, segment, &mobility);
  for (int k = 0; k < NC; ++k) {
    limit[k] = with_static ? stick_limit(scene, segment, k) : scene->friction[k];
    cones.was_sliding[k] = segment->contact[k].was_sliding;
    cones.is_touching[k] = segment->contact[k].is_touching;
    for (int i = 0; i < 2; ++i) cones.sliding_direction[2 * k + i] = segment->contact[k].sliding_direction[i];
  }
  if (!solve_of_least_norm(scene, &cones, &mobility, answers)) return;
  for (int k = 0; k < NC; ++k) {
    const double *r = answers[k].force, size = hypot(r[1], r[2]);
    /* On the boundary of its cone: where contacts are redundant, the forces of least norm would leave it. */
    if (answers[k].state == STICKS && size >= (1.0 - LIMIT_TOLERANCE) * limit[k] * r[0] && size > 0.0)
      let_slip(answers + k, r);
    put_mode(segment->p.contact + k, answers + k);
  }
}

/* Whether a contact touches or a joint that may be held is at rest; else there are no modes to find. */
static int anything_rests(const scene_t* scene, const real* x, const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->contact[k].is_touching != 0.0;
  for (int i = 0; i < ND; ++i) any |= rests(scene, x, i);
  return any;
}

/* Whether friction closes a sliding contact faster than its normal force opens it. One whose normal force moves nothing, since
 * a stop bears it, does not. */
static int any_jams(const scene_t* scene, const real* x, const segment_t* segment, const loads_t* loads) {
  LOCAL(mobility_t, mobility, mobility_of, MOBILITY);
  int has_mobility = 0;
  for (int k = 0; k < NC; ++k) {
    if (!is_sliding(segment->p.contact + k) || loads->grip[k] > 0.0) continue;
    if (!has_mobility) find_mobility(scene, x, segment, &mobility);
    has_mobility = 1;
    if (AT(mobility.W, MC, 3 * k, 3 * k) > 0.0) return 1;
  }
  return 0;
}

/* Try the modes of all joints at rest, with all contacts solved together for each: 1 if one satisfies the laws. This is the
 * last resort where pivoting cycles between joints and contacts. */
static int try_all(const scene_t* scene, const real* x, segment_t* segment) {
  int resting[NU], count = 0, combinations = 1;
  LOCAL(loads_t, loads, loads_of, LOADS);
  LOCAL(indeterminate_t, sets, indeterminate_of, INDETERMINATE);
  for (int i = 0; i < ND; ++i)
    if (rests(scene, x, i)) resting[count++] = i;
  for (int i = 0; i < count && combinations <= COMBINATION_LIMIT; ++i) combinations *= 3;
  for (int combination = 0; combination < (combinations < COMBINATION_LIMIT ? combinations : COMBINATION_LIMIT); ++combination)
    for (int with_static = 1; with_static >= 0; --with_static) {
      int set = 0;
      for (int i = 0, rest = combination; i < count; ++i, rest /= 3)
        segment->p.direction[resting[i]] = rest % 3 == 2 ? -1.0 : rest % 3;
      solve_all_contacts(scene, x, segment, with_static);
      find_loads(scene, x, segment, &loads);
      if (find_infeasible(scene, x, segment, &loads, 0, &sets, &set) < 0 && !any_jams(scene, x, segment, &loads)) return 1;
    }
  return 0;
}

/* Find the modes of all contacts and joints: 0 if none satisfies the laws, or the motion is not unique (Painlevé 1895). */
static int solve_modes(const scene_t* scene, const real* x, segment_t* segment, const geometry_t* geometry) {
  LOCAL(loads_t, loads, loads_of, LOADS);
  LOCAL(indeterminate_t, sets, indeterminate_of, INDETERMINATE);
  segment->has_turning = 0;
  guess_modes(scene, x, segment, geometry);
  if (!anything_rests(scene, x, segment)) return 1;
  for (int attempt = 0; attempt < 3; ++attempt) {
    for (int k = 0; k < PIVOTS; ++k) {
      find_loads(scene, x, segment, &loads);
      int set = 0;
      const int entry = find_infeasible(scene, x, segment, &loads, k >= WORST_FIRST, &sets, &set);
      if (entry < 0) return !any_jams(scene, x, segment, &loads);
      if (scene->indeterminate && set) {
        release_set(scene, x, segment, &sets, set);
        continue;
      }
      if (!pivot(scene, x, segment, &loads, entry)) break;
    }
    if (NC && attempt < 2) solve_all_contacts(scene, x, segment, attempt == 0);
  }
  return NC > 0 && ND > 0 && try_all(scene, x, segment);
}

/* Determine the modes of all joints and contacts at x under u, with the tunable quantities of p given; returns NONE or the
 * reason of a failure. */
EXPORTED long long find_modes(const scene_t* scene, const real* x, const real* u, real* p) {
  LOCAL_TICK(segment, u, p, P_LENGTH);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  find_geometry(scene, x, &segment, &geometry);
  const int settled = solve_modes(scene, x, &segment, &geometry);
  copy(p, segment.p.all, P_LENGTH);
  return settled ? NONE : UNDETERMINED;
}

/* Change of the reactions of the least norm in given modes, those of contacts (normal, and tangential ones where they stick)
 * and then of joints, to the nearest within all limits. */
EXPORTED void share_reactions(const scene_t* scene, const real* x, const real* u, const real* p, double* change) {
  LOCAL_TICK(segment, u, p, P_LENGTH);
  LOCAL(loads_t, loads, loads_of, LOADS);
  LOCAL(statics_t, balance, statics_of, STATICS);
  part_t parts[PARTS];
  for (int i = 0; i < FORCES; ++i) change[i] = 0.0;
  if (!scene->indeterminate) return;
  find_loads(scene, x, &segment, &loads);
  find_statics(scene, x, &segment, &balance);
  find_parts(scene, x, &segment, &loads, &balance, parts);
  find_nearest(scene, &balance, parts, change);
}
