/* SPDX-License-Identifier: Apache-2.0
 *
 * Positions of the joints' stops, both rigid and compliant, and detection of contact with them.
 *
 * Required definitions: NU (joints), LOWEST, HIGHEST (brace lists: positions of the stops, beyond every position where there
 * is none).
 */

static const double stop_place[2][NU] = {LOWEST, HIGHEST};

/* Whether a joint is at or beyond a stop. */
static inline int reaches_stop(double q, int joint) { return (q <= stop_place[0][joint]) | (q >= stop_place[1][joint]); }

/* Whether a joint that reverses in a motion with known ends may have been beyond a stop: 1 for the upper one, -1 for the
 * lower one, else 0. */
static inline int may_dip(double q, double v, double v_end, double length, int joint) {
  const double far = q + v * length;
  return (v * v_end < 0.0) * ((v > 0.0) & (far > stop_place[1][joint])) -
         (v * v_end < 0.0) * ((v < 0.0) & (far < stop_place[0][joint]));
}

/* Whether a joint may meet a stop in a motion from q, v to q_end, v_end. */
static inline int meets_stop(double q, double v, double q_end, double v_end, double length, int joint) {
  return reaches_stop(q, joint) | reaches_stop(q_end, joint) | (may_dip(q, v, v_end, length, joint) != 0);
}
