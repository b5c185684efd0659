# SPDX-License-Identifier: Apache-2.0
"""Write double_pendulum.json: two point masses of 1 kg on rods of 1 m, by Taylor series of high
order.

With absolute angles from the downward vertical the Lagrangian is L = w1² + w2²/2 + w1 w2 cos(th1 -
th2) + g (2 cos th1 + cos th2). Every value is computed twice, with different precision, and kept
to the digits that agree. Run: python make_double_pendulum.py (a minute or two)
"""

import json
from pathlib import Path

from mpmath import cos, fabs, mp, mpf, nstr, odefun, pi, sin

CASES = {"pi6_pi4": (6, 4, (1, 2, 5, 10)), "pi2_pi2": (2, 2, (1, 2, 5))}
DIGITS = 17


def rate(_: mpf, y: list[mpf]) -> list[mpf]:
    """Time derivative of (th1, th2, w1, w2)."""
    g = mpf("9.81")
    th1, th2, w1, w2 = y
    c, s = cos(th1 - th2), sin(th1 - th2)
    f1 = -s * w2**2 - 2 * g * sin(th1)
    f2 = s * w1**2 - g * sin(th2)
    det = 2 - c**2
    return [w1, w2, (f1 - c * f2) / det, (2 * f2 - c * f1) / det]


def solve(digits: int, part1: int, part2: int, times: tuple[int, ...]) -> list[list[mpf]]:
    """States at the given times [s], started at rest from pi/part1 and pi/part2."""
    mp.dps = digits
    flow = odefun(rate, 0, [pi / part1, pi / part2, mpf(0), mpf(0)])
    return [list(flow(t)) for t in times]


def main() -> None:
    """Solve each case at two precisions and compare."""
    content: dict[str, object] = {
        "about": "th1, th2 from the downward vertical [rad], w1, w2 [rad/s]; g 9.81 m/s^2"
    }
    for name, (part1, part2, times) in CASES.items():
        rough, fine = solve(22, part1, part2, times), solve(28, part1, part2, times)
        worst = max(
            fabs(a - b)
            for x, y in zip(rough, fine, strict=True)
            for a, b in zip(x, y, strict=True)
        )
        assert worst < mpf(10) ** -DIGITS, f"{name}: the two runs differ by {nstr(worst, 3)}"
        content[name] = {t: [nstr(x, DIGITS) for x in y] for t, y in zip(times, fine, strict=True)}
    Path(__file__).with_name("double_pendulum.json").write_text(
        json.dumps(content, indent=1) + "\n"
    )


if __name__ == "__main__":
    main()
