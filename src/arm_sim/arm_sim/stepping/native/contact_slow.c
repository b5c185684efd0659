/* SPDX-License-Identifier: Apache-2.0
 *
 * Sliding so slow that an explicit method cannot follow its direction. The same lines stand in Python in
 * contact_pieces.py, with the reasons, for machines without a compiler; a test holds the two together.
 *
 * Before this file: contact_pieces.c; MOST_PARTS, MUCH_TURN.
 */

/* Rate at which friction turns each contact that slides into its direction: 0 if none does. */
static int find_rates(const real* x, const piece_t* piece, loads_t* loads, where_t* where, double* rate) {
  inertia_t inertia;
  int any = 0;
  for (int k = 0; k < NC; ++k) {
    rate[k] = 0.0;
    any |= friction[k] > 0.0 && MODE(piece, k)[0] != 0.0 && MODE(piece, k)[1] == 0.0;
  }
  if (!any) return 0;
  find_loads(x, piece, loads);
  find_geometry(x, where);
  find_inertia(x, piece, &inertia);
  for (int k = 0; k < NC; ++k) {
    const int n = 3 * k;
    const real* mode = MODE(piece, k);
    if (!(friction[k] > 0.0 && mode[0] != 0.0 && mode[1] == 0.0)) continue;
    const double a = -mode[3], b = mode[2], size = hypot(where->speed[n + 1], where->speed[n + 2]);
    double across_it = a * a * AT(inertia.W, MC, n + 1, n + 1) + b * b * AT(inertia.W, MC, n + 2, n + 2);
    across_it += 2.0 * a * b * AT(inertia.W, MC, n + 1, n + 2);
    rate[k] = friction[k] * loads->force[n] * across_it / fmax(size, AT_REST);
  }
  return 1;
}

/* Contacts that slide so slowly that an explicit method cannot follow their direction: 1 if there are any. */
static int find_slow(const real* x, piece_t* piece, double tick) {
  double rate[NC];
  loads_t loads;
  where_t where;
  int any = 0;
  if (!find_rates(x, piece, &loads, &where, rate)) return 0;
  for (int k = 0; k < NC; ++k) {
    const real *s = where.speed + 3 * k + 1, *a = loads.rate + 3 * k + 1, *mode = MODE(piece, k);
    const double turn = fabs(mode[2] * a[1] - mode[3] * a[0]) * tick;
    piece->slow[k] = rate[k] > MOST_PARTS / tick && (mode[2] * a[0] + mode[3] * a[1] >= 0.0 ||
                                                     turn > MUCH_TURN * hypot(s[0], s[1]));
    any |= piece->slow[k];
  }
  return any;
}

/* How long a piece may be for slow sliding to be followed. */
static double find_reach(const real* x, const piece_t* piece, double tick) {
  double rate[NC], fastest = 1.0 / tick;
  loads_t loads;
  where_t where;
  if (!find_rates(x, piece, &loads, &where, rate)) return tick;
  for (int k = 0; k < NC; ++k) fastest = fmax(fastest, rate[k]);
  return fmax(1.0 / fastest, tick / MOST_PARTS);
}

/* Stop slow contacts that move against the direction in which they are to start. */
static void align(real* x, piece_t* piece) {
  where_t where;
  real anchor[2 * NC], was[NC];
  int any = 0;
  find_geometry(x, &where);
  for (int k = 0; k < NC; ++k) {
    const real* s = where.speed + 3 * k + 1;
    real* mode = MODE(piece, k);
    was[k] = mode[1];
    anchor[2 * k] = where.place[3 * k + 1];
    anchor[2 * k + 1] = where.place[3 * k + 2];
    if (!piece->slow[k] || mode[0] == 0.0 || mode[2] * s[0] + mode[3] * s[1] > 0.0) continue;
    mode[1] = 1.0;
    any = 1;
  }
  if (any) close_contacts(x, piece, anchor);
  for (int k = 0; k < NC; ++k) MODE(piece, k)[1] = was[k];
}
