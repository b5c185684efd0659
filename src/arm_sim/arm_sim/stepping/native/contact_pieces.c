/* SPDX-License-Identifier: Apache-2.0
 *
 * Smooth pieces of a motion with contacts: how long one lasts, and what is set right at its ends. The same lines stand in
 * Python in contact_pieces.py, with the reasons, for machines without a compiler; a test holds the two together.
 *
 * Before this file: contact_modes.c, events.c; ROUNDING, SUDDEN_STOP, SINKING, HELD, INDEPENDENT.
 */

/* Whether a contact is closed or a joint sticks. */
static int anything_held(const piece_t* piece) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= MODE(piece, k)[0] != 0.0;
  for (int i = 0; i < ND; ++i) any |= DIRECTION(piece)[i] == 0.0;
  return any;
}

/* Positive if a contact or joint does not obey its mode after a motion of length t. */
static double wrongness(const real* x, const piece_t* piece, const double* ground, double t) {
  const real *d = DIRECTION(piece), *v = x + NU;
  const double rounding = ROUNDING * (1.0 + largest_of(v, NU));
  double worst = -INFINITY;
  where_t where;
  loads_t loads;
  find_geometry(x, &where);
  if (anything_held(piece)) find_loads(x, piece, &loads);
  for (int k = 0; k < NC; ++k) {
    const real *r = loads.force + 3 * k, *s = where.speed + 3 * k, *mode = MODE(piece, k);
    if (mode[0] == 0.0) {
      worst = fmax(worst, ground[k] - where.place[3 * k] - SINKING * t - GAP_ROUNDING * where.size[k]);
      continue;
    }
    worst = fmax(worst, -r[0]);
    if (mode[1] != 0.0) worst = fmax(worst, hypot(r[1], r[2]) - friction[k] * r[0]);
    else if (friction[k] > 0.0) worst = fmax(worst, -(mode[2] * s[1] + mode[3] * s[2]) - rounding);
  }
  for (int i = 0; i < ND; ++i) {
    if (!(static_level[i] > 0.0)) continue;
    worst = fmax(worst, d[i] != 0.0 ? -v[i] * d[i] - rounding : fabs(loads.load[i]) - static_level[i]);
  }
  return worst;
}

/* What is looked for in a motion from x: a mode that is not obeyed, or (contact >= 0) a gap that begins to rise. */
typedef struct {
  const real* x;
  piece_t* piece;
  double ground[NC];
  int contact;
} search_t;

static double value_at(const void* asked, double t) {
  const search_t* search = asked;
  real after[NX];
  if (!try_flow(search->x, search->piece, t, after)) return INFINITY;
  if (search->contact < 0) return wrongness(after, search->piece, search->ground, t);
  where_t where;
  find_geometry(after, &where);
  return where.speed[3 * search->contact];
}

/* A time before `length` at which a contact is below its plane, on its way up again; 0 if there is none. */
static double dip_before(search_t* search, double length, const real* end) {
  real after[NX];
  where_t before, back;
  find_geometry(search->x, &before);
  find_geometry(end, &back);
  for (int k = 0; k < NC; ++k) {
    if (MODE(search->piece, k)[0] != 0.0 || !(before.speed[3 * k] < 0.0 && back.speed[3 * k] > 0.0)) continue;
    search->contact = k;
    const double turn = first_positive(value_at, search, length);
    search->contact = -1;
    if (try_flow(search->x, search->piece, turn, after) &&
        wrongness(after, search->piece, search->ground, turn) > 0.0)
      return turn;
  }
  return 0.0;
}

/* Motion to where the modes stop being right, at most over `reach`: its length, -1 if it cannot be computed. */
static double advance(const real* x, piece_t* piece, double reach, real* after, int* calm) {
  search_t search = {x, piece, {0.0}, -1};
  where_t where;
  find_geometry(x, &where);
  for (int k = 0; k < NC; ++k) search.ground[k] = fmin(where.place[3 * k], 0.0);
#ifdef ADAPTIVE
  const control_t kept = *piece->control;
#endif
  const int reached = flow(x, piece, reach, after);
  *calm = reached && wrongness(after, piece, search.ground, reach) <= 0.0;
  double length = reach;
  if (!*calm) {
#ifdef ADAPTIVE
    *piece->control = kept;
#endif
    length = first_positive(value_at, &search, reach);
    if (!flow(x, piece, length, after)) return -1.0;
  }
  const double dip = dip_before(&search, length, after);
  if (dip == 0.0) return length;
#ifdef ADAPTIVE
  *piece->control = kept;
#endif
  *calm = 0;
  length = first_positive(value_at, &search, dip);
  return flow(x, piece, length, after) ? length : -1.0;
}

/* Whether a closed contact is not quite closed, or does not quite rest. */
static int is_off(const real* x, const piece_t* piece) {
  const double limit = calm_speed(x) / 10.0;
  where_t where;
  find_geometry(x, &where);
  for (int k = 0; k < NC; ++k) {
    const real *mode = MODE(piece, k), *s = where.speed + 3 * k;
    if (mode[0] == 0.0) continue;
    if (fabs(where.place[3 * k]) > GAP_ROUNDING * where.size[k] || fabs(s[0]) > limit) return 1;
    if (mode[1] != 0.0 && (fabs(s[1]) > limit || fabs(s[2]) > limit)) return 1;
  }
  return 0;
}

/* Bring positions and velocities back to the closed contacts. */
static void close_contacts(real* x, const piece_t* piece, const real* anchor) {
  int any = 0;
  real after[NX];
  MEMORY;
  for (int k = 0; k < NC; ++k) any |= MODE(piece, k)[0] != 0.0;
  for (int turn = 0; any && turn < 2; ++turn) {
    arg[0] = x; arg[1] = piece->p; arg[2] = anchor;
    res[0] = after;
    contact_close(arg, res, iw, w, 0);
    for (int i = 0; i < 2 * NU; ++i) x[i] = after[i];
  }
}

/* What contacts will do whose mode has just come to its end: lift off, or slip. */
static void find_ended(const real* x, piece_t* piece, int calm) {
  loads_t loads;
  if (!calm) find_loads(x, piece, &loads);
  for (int k = 0; k < NC; ++k) {
    const real *r = loads.force + 3 * k, *mode = MODE(piece, k);
    piece->ended[k] = STICKS;
    if (calm || mode[0] == 0.0) continue;
    const double size = hypot(r[1], r[2]);
    if (r[0] <= 0.0) piece->ended[k] = APART;
    else if (mode[1] != 0.0 && size >= friction[k] * r[0] && friction[k] > 0.0) {
      piece->ended[k] = SLIDES;
      for (int i = 0; i < 2; ++i) piece->slips[k][i] = -r[1 + i] / size;
    }
  }
}

/* Rank of a symmetric matrix that is not negative, by elimination with diagonal pivots. */
static int rank_of(real* W) {
  double limit = 0.0;
  int count = 0;
  for (int i = 0; i < MC; ++i) limit += INDEPENDENT * AT(W, MC, i, i);
  for (; count < MC; ++count) {
    int k = 0;
    real row[MC], pivot;
    for (int i = 1; i < MC; ++i)
      if (AT(W, MC, i, i) > AT(W, MC, k, k)) k = i;
    pivot = AT(W, MC, k, k);
    if (!(pivot > limit)) break;
    for (int i = 0; i < MC; ++i) row[i] = AT(W, MC, i, k);
    for (int i = 0; i < MC; ++i)
      for (int j = 0; j < MC; ++j) AT(W, MC, i, j) -= row[i] * row[j] / pivot;
  }
  return count;
}

/* Whether the contacts leave no joint any motion. */
static int is_held(const real* x, const piece_t* piece) {
  if (largest_of(x + NU, NU) > HELD) return 0;
  inertia_t inertia;
  int free = NU;
  for (int i = 0; i < ND; ++i) free -= DIRECTION(piece)[i] == 0.0;
  find_inertia(x, piece, &inertia);
  for (int i = 0; i < MC; ++i)
    for (int j = 0; j < MC; ++j) {
      const real *a = MODE(piece, i / 3), *b = MODE(piece, j / 3);
      const double held = a[0] * b[0] * (i % 3 ? a[1] : 1.0) * (j % 3 ? b[1] : 1.0);
      AT(inertia.W, MC, i, j) *= held;
    }
  return rank_of(inertia.W) == free;
}

/* 0 if a joint that is put at rest was still fast: the piece was no continuous motion. */
static int rest(real* x, const piece_t* piece) {
  const real* d = DIRECTION(piece);
  const double fastest = largest_of(x + NU, NU);
  for (int i = 0; i < ND; ++i)
    if (static_level[i] > 0.0 && x[NU + i] * d[i] <= 0.0) {
      if (fabs(x[NU + i]) > SUDDEN_STOP * (1.0 + fastest)) return 0;
      x[NU + i] = 0.0;
    }
  return 1;
}

