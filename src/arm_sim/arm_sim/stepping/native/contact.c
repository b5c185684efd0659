/* SPDX-License-Identifier: Apache-2.0
 *
 * Ticks of a scene with contacts: smooth pieces between touch-downs, lift-offs, stops and starts. The same lines stand in
 * Python in contact.py, with the reasons, for machines without a compiler; a test holds the two together.
 *
 * Before this file: contact_impact.c, contact_slow.c; MOST_EVENTS, MOST_REBOUNDS, DEEP.
 */

/* Work of sliding contacts over a piece, by Simpson's rule. */
static double friction_work(const real* x, piece_t* piece, double h) {
  static const double weight[3] = {1.0, 4.0, 1.0};
  double work = 0.0;
  for (int part = 0; part < 3; ++part) {
    real there[NX];
    where_t where;
    loads_t loads;
    if (!try_flow(x, piece, 0.5 * part * h, there)) return work;
    find_geometry(there, &where);
    find_loads(there, piece, &loads);
    for (int i = 0; i < MC; ++i)
      if (i % 3) work -= weight[part] * h / 6.0 * loads.force[i] * where.speed[i];
  }
  return work;
}

static enum trouble contact_tick(real* x, piece_t* piece, double h, memory_t* memory) {
  real now[NX], after[NX], anchor[2 * NC];
  double left = h;
  int calm, impacts = 0;
  where_t where;
  for (int i = 0; i < NX; ++i) now[i] = x[i];
  find_geometry(now, &where);
  for (int k = 0; k < NC; ++k)
    if (where.place[3 * k] < -DEEP) return INSIDE;
  for (int k = 0; k < NC; ++k) piece->ended[k] = STICKS;
  for (long long event = 0; event < MOST_EVENTS; ++event) {
    const double lost = impact(now, piece, impacts < MOST_REBOUNDS);
    still(now);
    for (int k = 0; k < NC; ++k) piece->slow[k] = 0;
    if (lost < 0.0 || !settle(now, piece)) return UNDETERMINED;
    if (find_slow(now, piece, h)) {
      if (!settle(now, piece)) return UNDETERMINED;
      align(now, piece);
    }
    memory->loss += lost;
    memory->impacts += lost > 0.0;
    impacts += lost > 0.0;
    find_geometry(now, &where);
    for (int i = 0; i < 2 * NC; ++i) anchor[i] = where.place[3 * (i / 2) + 1 + i % 2];
    if (is_off(now, piece)) close_contacts(now, piece, anchor);
    if (is_held(now, piece)) {
      for (int i = 0; i < NX; ++i) x[i] = i < NU || i >= 2 * NU ? now[i] : 0.0;
      return NONE;
    }
    const double reach = fmin(left, find_reach(now, piece, h)), length = advance(now, piece, reach, after, &calm);
    if (length < 0.0) return NUMBERS;
    find_ended(after, piece, calm);
    close_contacts(after, piece, anchor);
    if (!rest(after, piece)) return NUMBERS;
    if (memory->audit) memory->friction += friction_work(now, piece, length);
    for (int i = 0; i < NX; ++i) now[i] = after[i];
    const int done = (calm && reach == left) || left - length <= 0.0;
    left -= length;
    if (done) {
      for (int i = 0; i < NX; ++i) x[i] = now[i];
      return NONE;
    }
  }
  return EVENTS;
}

static int event_tick(real* x, piece_t* piece, double h, void* remembered) {
  memory_t* memory = remembered;
  memory->trouble = contact_tick(x, piece, h, memory);
  return memory->trouble == NONE;
}
