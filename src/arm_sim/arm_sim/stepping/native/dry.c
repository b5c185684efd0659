/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of a scene with dry friction: smooth pieces between stops and break-aways. The same lines stand in Python in
 * dry_friction.py, with the reasons, for machines without a compiler; a test holds the two together.
 *
 * Before this file: dry_modes.c, events.c; EVENTS, ROUNDING, AT_REST.
 */

/* Positive if a joint slides against its direction or sticks under too much load. */
static double wrongness(const real* x, const piece_t* piece) {
  const real *d = DIRECTION(piece), *v = x + NU;
  double turned = -INFINITY, overload = -INFINITY, fastest = 0.0;
  int stuck = 0;
  for (int i = 0; i < NU; ++i) {
    if (fabs(v[i]) > fastest) fastest = fabs(v[i]);
    if (!(static_level[i] > 0.0)) continue;
    if (d[i] == 0.0) stuck = 1;
    else if (-v[i] * d[i] > turned) turned = -v[i] * d[i];
  }
  turned -= ROUNDING * (1.0 + fastest);
  if (stuck) {
    real load[NU];
    evaluate_reaction(x, piece, load);
    for (int i = 0; i < NU; ++i)
      if (static_level[i] > 0.0 && d[i] == 0.0 && fabs(load[i]) - static_level[i] > overload)
        overload = fabs(load[i]) - static_level[i];
  }
  return turned > overload ? turned : overload;
}

typedef struct {
  const real* x;
  piece_t* piece;
} search_t;

/* The same after a motion of length t. */
static double wrong_after(const void* asked, double t) {
  const search_t* search = asked;
  real after[NX];
  return try_flow(search->x, search->piece, t, after) ? wrongness(after, search->piece) : INFINITY;
}

/* 0 if a joint that is put at rest was still fast: the piece was no continuous motion. */
static int rest(real* x, const piece_t* piece) {
  const real* d = DIRECTION(piece);
  double fastest = 0.0;
  for (int i = 0; i < NU; ++i)
    if (fabs(x[NU + i]) > fastest) fastest = fabs(x[NU + i]);
  for (int i = 0; i < NU; ++i)
    if (static_level[i] > 0.0 && x[NU + i] * d[i] <= 0.0) {
      if (fabs(x[NU + i]) > AT_REST * (1.0 + fastest)) return 0;
      x[NU + i] = 0.0;
    }
  return 1;
}

static int event_tick(real* x, piece_t* piece, double h, void* memory) {
  real now[NX], after[NX];
  const search_t search = {now, piece};
  double left = h;
  (void)memory;
  for (int i = 0; i < NX; ++i) now[i] = x[i];
  for (long long event = 0; event < EVENTS; ++event) {
    double length = left;
    find_directions(now, piece);
    const int calm = wrong_after(&search, left) <= 0.0;
    if (!calm) length = first_positive(wrong_after, &search, left);
    if (!flow(now, piece, length, after)) return 0;
    if (!rest(after, piece)) return 0;
    for (int i = 0; i < NX; ++i) now[i] = after[i];
    left -= length;
    if (calm || left <= 0.0) {
      for (int i = 0; i < NX; ++i) x[i] = now[i];
      return 1;
    }
  }
  return 0;
}
