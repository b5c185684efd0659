/* SPDX-License-Identifier: Apache-2.0
 *
 * Positions of the joints' stops, both rigid and compliant, and detection of contact with them.
 *
 * Required definitions: NU (joints), LOWEST, HIGHEST (brace lists: positions of the stops, beyond every position where there
 * is none).
 */

static const double stop_place[2][NU] = {LOWEST, HIGHEST};

/* Whether a joint may meet a stop in a motion from q, v to q_end, v_end: whether the cubic with these ends leaves the room
 * between the stops. Its Bernstein coefficients bound it, and its error is smaller than its distance from a motion at
 * constant acceleration; `margin` is added to that.
 */
static inline int meets_stop(double q, double v, double q_end, double v_end, double length, double margin, int joint) {
  const double third = length / 3.0, a = q + third * v, b = q_end - third * v_end;
  const double bend = margin + __builtin_fabs(q_end - q - 0.5 * length * (v + v_end));
  const double low = stop_place[0][joint] + bend, high = stop_place[1][joint] - bend;
  return (q <= low) | (q >= high) | (q_end <= low) | (q_end >= high) | (a <= low) | (a >= high) | (b <= low) | (b >= high);
}
