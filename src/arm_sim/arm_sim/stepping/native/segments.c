/* SPDX-License-Identifier: Apache-2.0
 *
 * Smooth segments between events: how long the modes remain valid, and corrections at the ends.
 *
 * Required definitions: modes.c, search.c, stops.c; the generated `contact_close`.
 */

#define TURNING_BACK 1e-13 /* relative speed in the wrong direction tolerated of a joint that begins to slide */
#define SUDDEN_STOP 1e-6   /* speed tolerated of a joint that is found to stop, relative to the fastest joint */
#define SINKING 1e-12      /* speed up to which an open contact is not treated as approaching */
#define HELD 1e-9          /* speed treated as rounding if all joints of an arm are held */
#define INDEPENDENT 1e-10  /* part of a row that must be left by those before it, for it to count for the rank */
#define MOST_PARTS 32      /* segments into which slow sliding may divide a tick ... */
#define MUCH_TURN 0.05     /* ... and rotation of its direction in a tick that is large [rad] */
#define SHORT_WAY 1e-9      /* correction to contacts whose square is far below rounding: a second step is unnecessary */
#define AT_ITS_END 1e-9     /* violation at which a mode has ended where error control is stuck */
#define NOTHING 1e-15       /* violation treated as rounding */
#define SURELY 1.2          /* time at which a mode has certainly ended, as a multiple of the predicted one ... */
#define FARTHER 4.0         /* ... and the next trial if no mode has ended by then */

/* Motion over h that does not update the error control: 1 if it can be computed. */
static int try_flow(const real* x, const segment_t* segment, double h, real* after) {
  control_t kept = segment->control ? *segment->control : (control_t){0};
  const long long before = kept.attempts;
  const int good = flow(x, segment->u, (const real*)&segment->p, h, segment->control ? &kept : 0, after);
  *segment->work += COST_STEP * (1 + kept.attempts - before);
  return good;
}

/* Motion over the whole of a segment, see `flow`; it may be foreseen. */
static int flow_on(const real* x, const segment_t* segment, double h, real* after) {
  const foreseen_t* known = segment->foreseen;
  if (!is_foreseen(segment) || h != known->length || !same(x, known->x, NX))
    return flow(x, segment->u, (const real*)&segment->p, h, segment->control, after);
  memcpy(after, known->after, sizeof known->after);
  return within_reach(after);
}

/* Whether a contact is closed or a joint sticks. */
static int anything_held(const segment_t* segment) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= segment->p.contact[k].closed != 0.0;
  for (int i = 0; i < ND; ++i) any |= segment->p.direction[i] == 0.0;
  return any;
}

/* Event functions, which must not be positive: of contacts gaps, or normal and tangential forces; of joints friction, and
 * both stops; of the sets that hold together the largest excess, in place of those of their parts. Each is smooth in time
 * while the modes last.
 */
typedef struct { double contact[2 * NC], joint[ND], stop[2 * NU], pressed[2 * NQ], together; } limits_t;
#define LIMITS ((int)(sizeof(limits_t) / sizeof(double)))
static void fill(limits_t* limits, double value) {
  for (int i = 0; i < LIMITS; ++i) ((double*)limits)[i] = value;
}
static double worst_of(const limits_t* limits) { return largest_among((const double*)limits, LIMITS); }

/* Positive where a joint is beyond a rigid stop, meets a compliant one or separates from it, after a motion of length t. */
static void stop_disobedience(const real* x, const segment_t* segment, double t, limits_t* limits) {
  double met[2][NU], push[2][NU];
#ifdef RIGID
  for (int i = 0; i < NU; ++i) {
    if (segment->p.direction[i] == 0.0) continue;
    const double room = SINKING * t + GAP_ROUNDING * (1.0 + fabs(x[i]));
    limits->stop[2 * i] = lower_stop[i] - x[i] - room;
    limits->stop[2 * i + 1] = x[i] - upper_stop[i] - room;
  }
#else
  (void)t;
#endif
  if (NQ) find_pressures(x, met, push);
  for (int i = 0; i < NQ; ++i)
    for (int side = 0; side < 2; ++side)
      limits->pressed[2 * i + side] = segment->p.pressed[i] == (side ? 1.0 : -1.0) ? -push[side][i] : met[side][i];
}

/* Speed against its direction that a sliding joint may have by rounding. */
static double turning_rounding(const real* x) { return TURNING_BACK * (1.0 + largest_of(x + NU, NU)); }

#ifdef TOGETHER
/* Replace the limits of parts that hold together by that of their sets, where reactions of the least norm are beyond. */
static void hold_together(const real* x, const segment_t* segment, const loads_t* found, limits_t* limits) {
  together_t together;
  if (!anything_beyond(x, segment, found)) return;
  find_sets_held(x, segment, found, &together);
  for (int i = 0; i < ND; ++i)
    if (together.set[i]) limits->joint[i] = -INFINITY;
  for (int k = 0; k < NC; ++k) {
    if (!together.set[NU + k]) continue;
    limits->contact[2 * k] = -INFINITY;
    if (segment->p.contact[k].sticks != 0.0) limits->contact[2 * k + 1] = -INFINITY;
  }
  for (int i = 0; i < PARTS; ++i)
    if (together.set[i]) limits->together = fmax(limits->together, set_excess(segment, &together, together.set[i]));
}
#endif

/* Positive where a contact or joint violates its mode after a motion of length t; returns the largest violation. */
static double disobedience(const real* x, const segment_t* segment, const double* ground, double t, limits_t* limits) {
  const real *d = segment->p.direction, *v = x + NU;
  const double rounding = turning_rounding(x);
  geometry_t geometry;
  loads_t found;
  fill(limits, -INFINITY);
  find_geometry(x, segment, &geometry);
  if (anything_held(segment)) find_loads(x, segment, &found);
  for (int k = 0; k < NC; ++k) {
    const real *r = found.force + 3 * k, *s = geometry.speed + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    if (mode->closed == 0.0) {
      limits->contact[2 * k] = ground[k] - geometry.place[3 * k] - SINKING * t - GAP_ROUNDING * geometry.size[k];
      continue;
    }
    limits->contact[2 * k] = -r[0];
    if (mode->sticks != 0.0) limits->contact[2 * k + 1] = hypot(r[1], r[2]) - stick_limit(segment, k) * r[0];
    else if (holding[k] > 0.0) limits->contact[2 * k + 1] = -(mode->along[0] * s[1] + mode->along[1] * s[2]) - rounding;
  }
  for (int i = 0; i < ND; ++i) {
    if (d[i] == 0.0) limits->joint[i] = joint_excess(x, &found, i);
    else if (may_stick(i)) limits->joint[i] = -v[i] * d[i] - rounding;
  }
#ifdef TOGETHER
  if (anything_held(segment)) hold_together(x, segment, &found, limits);
#endif
  stop_disobedience(x, segment, t, limits);
  return worst_of(limits);
}

/* A motion from x, and a further event that may be searched in it: where a contact begins to rise, or a joint (joint >= 0)
 * to return from its upper (side 1) or lower (side -1) stop. */
typedef struct {
  const real* x;
  const segment_t* segment;
  double ground[NC];
  int contact, joint, side;
} search_t;

/* The state after a motion of length t: 0 if it cannot be computed. */
static int state_at(const search_t* search, double t, real* after) {
  if (t > 0.0) return try_flow(search->x, search->segment, t, after);
  memcpy(after, search->x, NX * sizeof *after);
  return 1;
}

/* Whether all modes are satisfied after a motion of length t. */
static double excess_at(const search_t* search, double t, limits_t* limits) {
  real after[NX];
  if (state_at(search, t, after)) return disobedience(after, search->segment, search->ground, t, limits);
  fill(limits, INFINITY);
  return INFINITY;
}

static void limits_at(const void* asked, double t, double* limits) { excess_at(asked, t, (limits_t*)limits); }

/* The speed at which a contact rises, or a joint returns from a stop. */
static void return_at(const void* asked, double t, double* speed) {
  const search_t* search = asked;
  real after[NX];
  geometry_t geometry;
  *speed = INFINITY;
  if (!state_at(search, t, after)) return;
  if (search->joint >= 0) *speed = -search->side * after[NU + search->joint];
  else {
    find_geometry(after, search->segment, &geometry);
    *speed = geometry.speed[3 * search->contact];
  }
}

/* A time before `length` at which a contact is below its plane and begins to rise; 0 if there is none. */
static double dip_before(search_t* search, double length, const real* end, limits_t* depth) {
  geometry_t before, back;
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= search->segment->p.contact[k].closed == 0.0;
  if (!any) return 0.0;
  find_geometry(search->x, search->segment, &before);
  find_geometry(end, search->segment, &back);
  for (int k = 0; k < NC; ++k) {
    const int apart = search->segment->p.contact[k].closed == 0.0;
    if (!apart || !(before.speed[3 * k] < 0.0 && back.speed[3 * k] > 0.0)) continue;
    search->contact = k;
    const double speed = back.speed[3 * k], turn = first_positive(return_at, search, 1, length, &speed, NOTHING);
    const double excess = excess_at(search, turn, depth);
    if (excess > 0.0 && excess < INFINITY) return turn;
  }
  return 0.0;
}

/* A time before `length` at which a joint is beyond a stop and begins to return; 0 if there is none. */
static double bump_before(search_t* search, double length, const real* end, limits_t* depth) {
  for (int i = 0; i < NU; ++i) {
    const int side = may_dip(search->x[i], search->x[NU + i], end[NU + i], length, i);
    if (!side) continue;
    search->joint = i;
    search->side = side;
    const double speed = -side * end[NU + i], turn = first_positive(return_at, search, 1, length, &speed, NOTHING);
    search->joint = -1;
    const double excess = excess_at(search, turn, depth);
    if (excess > 0.0 && excess < INFINITY) return turn;
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
#ifdef RIGID
    if (segment->p.direction[i] == 0.0) continue;
    const double below = GAP_ROUNDING * (1.0 + fabs(x[i]));
    soonest = fmin(soonest, fmin(arrival(x[i] - lower_stop[i] + below, -v, -a), arrival(upper_stop[i] - x[i] + below, v, a)));
#endif
  }
  for (int k = 0; k < NC; ++k) {
    const double gap = fmax(geometry->place[3 * k], 0.0) + GAP_ROUNDING * geometry->size[k];
    if (segment->p.contact[k].closed == 0.0)
      soonest = fmin(soonest, arrival(gap, -geometry->speed[3 * k], -found.rate[3 * k]));
  }
  return SURELY * soonest;
}

/* Motion to the end of the modes, at most over `reach`: its length, -1 if it cannot be computed. */
static double advance(const real* x, segment_t* segment, double reach, real* after, int* calm) {
  search_t search = {.x = x, .segment = segment, .joint = -1};
  const control_t kept = segment->control ? *segment->control : (control_t){0};
  geometry_t geometry;
  limits_t limits, early;
  find_geometry(x, segment, &geometry);
  for (int k = 0; k < NC; ++k) search.ground[k] = fmin(geometry.place[3 * k], 0.0);
  const int reached = flow_on(x, segment, reach, after);
  *segment->work += COST_STEP * (1 + (segment->control ? segment->control->attempts - kept.attempts : 0));
  double known = reach, wrong = INFINITY, length = reach;
  if (reached) wrong = disobedience(after, segment, search.ground, reach, &limits);
  else fill(&limits, INFINITY);
  *calm = wrong <= 0.0;
  if (!reached && segment->control) {
    /* The direction of a contact is undefined as it comes to rest: error control follows it as far as possible. */
    known = length = segment->control->reached;
    if (known <= 0.0) return -1.0;
    wrong = disobedience(after, segment, search.ground, known, &limits);
    if (wrong <= AT_ITS_END) wrong = 0.0;
  }
  if (wrong > 0.0) {
    if (segment->control) *segment->control = kept;
    for (double near = find_next(x, segment, &geometry); near < known; near *= FARTHER) {
      if (!(excess_at(&search, near, &early) > 0.0)) continue;
      known = near;
      limits = early;
    }
    length = first_positive(limits_at, &search, LIMITS, known, (const double*)&limits, NOTHING);
    if (!flow(x, segment->u, (const real*)&segment->p, length, segment->control, after)) {
      if (!segment->control || segment->control->reached <= 0.0) return -1.0;
      length = segment->control->reached;
    }
  }
  double dip = dip_before(&search, length, after, &limits);
  if (dip == 0.0) dip = bump_before(&search, length, after, &limits);
  if (dip == 0.0) return length;
  if (segment->control) *segment->control = kept;
  *calm = 0;
  length = first_positive(limits_at, &search, LIMITS, dip, (const double*)&limits, NOTHING);
  return flow(x, segment->u, (const real*)&segment->p, length, segment->control, after) ? length : -1.0;
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
  const foreseen_t* known = segment->foreseen;
  WORKSPACE;
  if (NC && is_foreseen(segment) && known->closes && same(x, known->after, 2 * NU) && same(anchor, known->anchor, 2 * NC)) {
    memcpy(after, known->closed, sizeof known->closed);
    return;
  }
  arg[0] = x; arg[1] = (const real*)&segment->p; arg[2] = anchor;
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
    if (way < SHORT_WAY) break;
  }
}

/* Bring all touching points to rest where closing some contacts has moved others into their planes.
 *
 * The impact that stopped the former has opened the latter, but below the threshold: a body that rocks so little is at rest.
 */
static void rest_touching(real* x, const segment_t* segment, const real* anchor) {
  const double calm = speed_rounding(x);
  geometry_t geometry;
  segment_t resting = *segment;
  int any = 0;
  if (NC < 2) return;
  find_geometry(x, segment, &geometry);
  for (int k = 0; k < NC; ++k) {
    if (!segment->contact[k].touching) continue;
    any |= segment->p.contact[k].closed == 0.0 && geometry.speed[3 * k] < -calm;
    resting.p.contact[k].closed = 1.0;
  }
  if (any) close_contacts(x, &resting, anchor);
}

/* Position of each point in its plane's tangents. */
static void find_anchors(const geometry_t* geometry, real* anchor) {
  for (int i = 0; i < 2 * NC; ++i) anchor[i] = geometry->place[3 * (i / 2) + 1 + i % 2];
}

/* Next mode of contacts whose mode has just ended: lift off, or slip; and whether a set that holds together has. */
static void find_ended(const real* x, segment_t* segment, int calm) {
  loads_t found;
  together_t together;
  memset(together.set, 0, sizeof together.set);
  segment->yields = 0;
  if ((NC || NB) && !calm) find_loads(x, segment, &found);
#ifdef TOGETHER
  if (!calm) {
    segment->yields = 1; /* an evaluation at the limit */
    find_sets_held(x, segment, &found, &together);
    int any = 0;
    for (int i = 0; i < PARTS; ++i) any |= together.set[i] && set_excess(segment, &together, together.set[i]) > 0.0;
    segment->yields = any;
  }
#endif
  for (int k = 0; k < NC; ++k) {
    const real* r = found.force + 3 * k;
    const contact_mode_t* mode = segment->p.contact + k;
    contact_t* contact = segment->contact + k;
    contact->ended = STICKS;
    if (calm || mode->closed == 0.0 || together.set[NU + k]) continue;
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
  (void)x;
#ifdef RIGID
  for (int i = 0; i < NU; ++i) {
    if (x[i] < lower_stop[i]) x[i] = lower_stop[i];
    if (x[i] > upper_stop[i]) x[i] = upper_stop[i];
  }
#endif
}

/* Rank of a positive semidefinite matrix whose rows may be of very different size, by elimination with diagonal pivots. */
static int rank_of(real* W) {
  double trace = 0.0, root[MC];
  int count = 0;
  for (int i = 0; i < MC; ++i) trace += AT(W, MC, i, i);
  for (int i = 0; i < MC; ++i) root[i] = AT(W, MC, i, i) > IMMOBILE * trace ? 1.0 / sqrt(AT(W, MC, i, i)) : 0.0;
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) AT(W, MC, i, j) *= root[i] * root[j];
  for (; count < MC; ++count) {
    int k = 0;
    real row[MC];
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
  arg[0] = x; arg[1] = segment->u; arg[2] = (const real*)&segment->p;
  res[0] = &rank; res[1] = 0;
  bilateral(arg, res, iw, w, 0);
  return (int)(rank + 0.5);
}

/* Whether friction, constraints and contacts leave no degree of freedom. */
static int is_held(const real* x, const segment_t* segment) {
  if (largest_of(x + NU, NU) > HELD) return 0;
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

/* Contacts that slide so slowly that an explicit method cannot follow their direction: 1 if there are any.
 *
 * Friction rotates the velocity of a contact towards its direction at the rate mu lambda w / s, with w the transverse
 * acceleration per force and s its speed. A contact that speeds up or turns is given the direction in which it would start
 * from rest; the stop of one on a straight line is located exactly.
 */
static int find_slow(const real* x, segment_t* segment, double tick) {
  double rate[NC];
  loads_t found;
  geometry_t geometry;
  int any = 0;
  if (!find_rates(x, segment, &found, &geometry, rate)) return 0;
  for (int k = 0; k < NC; ++k) {
    const real *s = geometry.speed + 3 * k + 1, *a = found.rate + 3 * k + 1, *along = segment->p.contact[k].along;
    const double turn = fabs(along[0] * a[1] - along[1] * a[0]) * tick;
    segment->contact[k].slow = rate[k] > MOST_PARTS / tick && (along[0] * a[0] + along[1] * a[1] >= 0.0 ||
                                                                turn > MUCH_TURN * hypot(s[0], s[1]));
    any |= segment->contact[k].slow;
  }
  return any;
}

/* Longest segment over which slow sliding can be followed. */
static double find_reach(const real* x, const segment_t* segment, double tick) {
  double rate[NC], fastest = 1.0 / tick;
  loads_t found;
  geometry_t geometry;
  if (!find_rates(x, segment, &found, &geometry, rate)) return tick;
  for (int k = 0; k < NC; ++k) fastest = fmax(fastest, rate[k]);
  return fmax(1.0 / fastest, tick / MOST_PARTS);
}

/* Stop slow contacts that move against the direction in which they would start. */
static void align(real* x, const segment_t* segment) {
  geometry_t geometry;
  real anchor[2 * NC];
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
