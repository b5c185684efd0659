/* SPDX-License-Identifier: Apache-2.0
 *
 * What contacts and joints with dry friction do next. The same lines stand in Python in contact_modes.py,
 * with the reasons, for machines without a compiler; a test holds the two together.
 *
 * Before this file: cone.c, cones.c; NX, NU, NP, ND (joints with directions in p: NU or 0), STATIC and RESTITUTION (brace lists),
 * SZ_ARG, SZ_RES, SZ_IW, SZ_W (of the functions called), PIVOTS, GAP_ROUNDING, HOP, SPEED_ROUNDING, AT_REST, LEAST_REBOUND,
 * SLACK, EDGE; with error control also adaptive.c and ADAPTIVE.
 */

enum trouble { NONE, NUMBERS, EVENTS, UNDETERMINED, INSIDE };

typedef struct {
  double loss;       /* energy lost in impacts ... */
  double friction;   /* ... and to friction of contacts, added up only on audit */
  long long impacts;
  long long audit;
  long long trouble; /* why the last tick failed */
} memory_t;

typedef struct {
  const real* u;            /* torque that acts */
  real p[NP + ND + 5 * NC]; /* parameters, directions of the joints, modes of the contacts */
  double given[NC][2];      /* direction in which a contact slides already ... */
  int slides[NC];           /* ... where it does */
  int touching[NC];
  int slow[NC];             /* counts as at rest */
  int ended[NC];            /* how its last mode came to its end: APART, SLIDES, else STICKS ... */
  double slips[NC][2];      /* ... and in which direction it will slide */
#ifdef ADAPTIVE
  control_t* control;
#endif
} piece_t;

typedef struct { real place[MC], speed[MC], size[NC]; } where_t; /* contact points in their planes' axes */
typedef struct { real force[MC], rate[MC], load[NU], grip[NC]; } loads_t;
typedef struct { real W[MC * MC], B[NU * MC], free[MC]; } inertia_t;
static const double static_level[NU] = STATIC;
static const double restitution[NC] = RESTITUTION;

#define DIRECTION(piece) ((piece)->p + NP)
#define MODE(piece, k) ((piece)->p + NP + ND + 5 * (k))

#define MEMORY real w[SZ_W]; casadi_int iw[SZ_IW]; const real* arg[SZ_ARG]; real* res[SZ_RES]

static void find_geometry(const real* x, where_t* where) {
  MEMORY;
  arg[0] = x;
  res[0] = where->place; res[1] = where->speed; res[2] = where->size;
  contact_geometry(arg, res, iw, w, 0);
}

static void find_loads(const real* x, const piece_t* piece, loads_t* loads) {
  MEMORY;
  arg[0] = x; arg[1] = piece->u; arg[2] = piece->p;
  res[0] = loads->force; res[1] = loads->rate; res[2] = loads->load; res[3] = loads->grip;
  contact_look(arg, res, iw, w, 0);
}

static void find_inertia(const real* x, const piece_t* piece, inertia_t* inertia) {
  MEMORY;
  arg[0] = x; arg[1] = piece->u; arg[2] = piece->p;
  res[0] = inertia->W; res[1] = inertia->B; res[2] = inertia->free;
  contact_inertia(arg, res, iw, w, 0);
}

static double largest_of(const real* values, int count) {
  double largest = 0.0;
  for (int i = 0; i < count; ++i)
    if (fabs(values[i]) > largest) largest = fabs(values[i]);
  return largest;
}

static double sign_of(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }

static double calm_speed(const real* x) { return SPEED_ROUNDING * (1.0 + largest_of(x + NU, NU)); }

/* Put joints with dry friction at rest that a closed contact keeps there but for rounding. */
static void still(real* x) {
  const double limit = calm_speed(x);
  for (int i = 0; i < ND; ++i)
    if (static_level[i] > 0.0 && fabs(x[NU + i]) <= limit) x[NU + i] = 0.0;
}

/* Speeds of hops that would not rise above the rounding of the gap. */
static void find_hops(const real* x, const piece_t* piece, const where_t* where, double* hop) {
  inertia_t inertia;
  double fall = 0.0;
  find_inertia(x, piece, &inertia);
  for (int k = 0; k < NC; ++k) fall = fmax(fall, fabs(inertia.free[3 * k]));
  for (int k = 0; k < NC; ++k) hop[k] = LEAST_REBOUND + sqrt(2.0 * fall * HOP * where->size[k]);
}

static void find_touching(const real* x, const piece_t* piece, const where_t* where, int* touching) {
  double hop[NC];
  int opens = 0;
  for (int k = 0; k < NC; ++k) {
    touching[k] = where->place[3 * k] <= 4 * GAP_ROUNDING * where->size[k];
    opens |= touching[k] && where->speed[3 * k] > calm_speed(x);
  }
  if (!opens) return;
  find_hops(x, piece, where, hop);
  for (int k = 0; k < NC; ++k) touching[k] &= where->speed[3 * k] <= hop[k];
}

/* Take it that all that touch carry, and those at rest stick. */
static void guess(const real* x, piece_t* piece) {
  where_t where;
  for (int i = 0; i < ND; ++i) DIRECTION(piece)[i] = static_level[i] > 0.0 ? sign_of(x[NU + i]) : 1.0;
  find_geometry(x, &where);
  find_touching(x, piece, &where, piece->touching);
  for (int k = 0; k < NC; ++k) {
    const real* s = where.speed + 3 * k + 1;
    const double size = hypot(s[0], s[1]);
    const int rests = friction[k] > 0.0 && (size <= AT_REST || piece->slow[k]), turns = friction[k] > 0.0 && !rests;
    real* mode = MODE(piece, k);
    piece->slides[k] = !rests;
    piece->given[k][0] = turns ? s[0] / size : 1.0;
    piece->given[k][1] = turns ? s[1] / size : 0.0;
    mode[0] = piece->touching[k];
    mode[1] = piece->touching[k] && rests;
    mode[2] = piece->given[k][0];
    mode[3] = piece->given[k][1];
    mode[4] = rests;
    if (!piece->touching[k] || piece->ended[k] == STICKS) continue;
    if (piece->ended[k] == APART) mode[0] = 0.0;
    if (piece->ended[k] == SLIDES && !rests) continue;
    mode[1] = 0.0;
    mode[2] = piece->ended[k] == SLIDES ? piece->slips[k][0] : 1.0;
    mode[3] = piece->ended[k] == SLIDES ? piece->slips[k][1] : 0.0;
  }
}

static void worst_joint(const real* x, const piece_t* piece, const loads_t* loads, double* most, int* worst) {
  const real* d = DIRECTION(piece);
  int any = 0;
  for (int i = 0; i < ND; ++i) any |= static_level[i] > 0.0 && x[NU + i] == 0.0;
  if (!any) return;
  real slope[NX];
  MEMORY;
  arg[0] = x; arg[1] = piece->u; arg[2] = piece->p;
  res[0] = slope;
  rhs(arg, res, iw, w, 0);
  const real* a = slope + NU;
  const double fastest = largest_of(a, NU), highest = largest_of(static_level, NU);
  for (int i = 0; i < ND; ++i) {
    if (!(static_level[i] > 0.0 && x[NU + i] == 0.0)) continue;
    const double excess = d[i] == 0.0 ? (fabs(loads->load[i]) - static_level[i]) / highest
                                      : -d[i] * a[i] / (1.0 + fastest) - SLACK;
    if (excess > *most) {
      *most = excess;
      *worst = NC + i;
    }
  }
}

/* The entry that disobeys most: a contact, or NC plus a joint; -1 if all obey. */
static int find_worst(const real* x, const piece_t* piece, const loads_t* loads) {
  const double heaviest = 1.0 + largest_of(loads->force, MC), fastest = 1.0 + largest_of(loads->rate, MC);
  double most = 0.0;
  int worst = -1;
  for (int k = 0; k < NC; ++k) {
    const real *r = loads->force + 3 * k, *a = loads->rate + 3 * k, *mode = MODE(piece, k);
    double excess = 0.0;
    if (mode[0] == 0.0) excess = piece->touching[k] ? -a[0] / fastest - SLACK : 0.0;
    else if (r[0] < 0.0) excess = -r[0] / heaviest;
    else if (mode[1] != 0.0) excess = (hypot(r[1], r[2]) - friction[k] * r[0]) / heaviest;
    else if (!piece->slides[k])
      excess = fmax(-(mode[2] * a[1] + mode[3] * a[2]), fabs(mode[2] * a[2] - mode[3] * a[1])) / fastest - SLACK;
    if (excess > most) {
      most = excess;
      worst = k;
    }
  }
  if (ND) worst_joint(x, piece, loads, &most, &worst);
  return worst;
}

static void put_mode(real* mode, const answer_t* answer) {
  mode[0] = answer->does == SLIDES || answer->does == STICKS;
  mode[1] = answer->does == STICKS;
  mode[2] = answer->direction[0];
  mode[3] = answer->direction[1];
}

/* Let the entry do what obeys while the others stay as they are: 0 if nothing does. */
static int pivot(const real* x, piece_t* piece, const loads_t* loads, int entry) {
  if (entry >= NC) {
    real* d = DIRECTION(piece) + entry - NC;
    *d = *d == 0.0 ? sign_of(loads->load[entry - NC]) : 0.0;
    return 1;
  }
  inertia_t inertia;
  double block[3][3], c[3];
  const real* r = loads->force + 3 * entry;
  real* mode = MODE(piece, entry);
  find_inertia(x, piece, &inertia);
  own_block(inertia.W, entry, block);
  for (int i = 0; i < 3; ++i)
    c[i] = loads->rate[3 * entry + i] - (block[i][0] * r[0] + block[i][1] * r[1] + block[i][2] * r[2]);
  answer_t answer = single(block, c, friction[entry], piece->slides[entry] ? piece->given[entry] : 0);
  if (answer.does == UNSOLVABLE) return 0;
  const enum does does = mode[0] == 0.0 ? APART : mode[1] != 0.0 ? STICKS : SLIDES;
  if (answer.does == does && does == STICKS) { /* at the very edge */
    const double size = hypot(r[1], r[2]);
    answer.does = SLIDES;
    answer.direction[0] = -r[1] / size;
    answer.direction[1] = -r[2] / size;
  } else if (answer.does == does && does == APART) {
    answer.does = piece->slides[entry] ? SLIDES : STICKS;
    answer.direction[0] = mode[2];
    answer.direction[1] = mode[3];
  }
  put_mode(mode, &answer);
  return 1;
}

/* Whether a contact touches or a joint with dry friction is at rest: else there is nothing to find. */
static int anything_rests(const real* x, const piece_t* piece) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= piece->touching[k];
  for (int i = 0; i < ND; ++i) any |= static_level[i] > 0.0 && x[NU + i] == 0.0;
  return any;
}

/* Find what every contact and joint does: 0 if there is nothing that obeys, or no single one. */
static int settle(const real* x, piece_t* piece) {
  loads_t loads;
  guess(x, piece);
  if (!anything_rests(x, piece)) return 1;
  for (int attempt = 0; attempt < 3; ++attempt) {
    for (int k = 0; k < PIVOTS; ++k) {
      find_loads(x, piece, &loads);
      const int worst = find_worst(x, piece, &loads);
      if (worst < 0) {
        for (int i = 0; i < NC; ++i)
          if (MODE(piece, i)[0] != 0.0 && MODE(piece, i)[1] == 0.0 && !(loads.grip[i] > 0.0)) return 0;
        return 1;
      }
      if (!pivot(x, piece, &loads, worst)) break;
    }
    if (attempt == 0) {
      inertia_t inertia;
      answer_t answers[NC];
      cones_t cones = {.W = inertia.W, .c = inertia.free};
      find_inertia(x, piece, &inertia);
      for (int k = 0; k < NC; ++k) {
        cones.slides[k] = piece->slides[k];
        cones.allowed[k] = piece->touching[k];
        for (int i = 0; i < 2; ++i) cones.given[k][i] = piece->given[k][i];
      }
      several(&cones, answers);
      for (int k = 0; k < NC; ++k) {
        const double *r = answers[k].force, size = hypot(r[1], r[2]);
        if (answers[k].does == STICKS && size >= (1.0 - EDGE) * friction[k] * r[0] && size > 0.0) {
          answers[k].does = SLIDES;
          for (int i = 0; i < 2; ++i) answers[k].direction[i] = -r[1 + i] / size;
        }
        put_mode(MODE(piece, k), answers + k);
      }
    }
  }
  return 0;
}
