# SPDX-License-Identifier: Apache-2.0
"""Write double_pendulum.json and stiff_elbow.json: two point masses of 1 kg on rods of 1 m, by
Taylor series of high order.

With absolute angles from the downward vertical the Lagrangian is L = w1² + w2²/2 + w1 w2 cos(th1 -
th2) + g (2 cos th1 + cos th2); a stiff elbow adds the torque -b (w2 - w1). All start at rest.
Every value is computed twice, with different precision, and kept to the digits that agree. Run:
python make_double_pendulums.py (some minutes)
"""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from mpmath import cos, mp, mpf, nstr, odefun, pi, sin

Motion = dict[str, list[str]]
Start = Callable[[], list[mpf]]  # angles, to the precision that is set


def rate(y: list[mpf], b: int) -> list[mpf]:
    """Time derivative of (th1, th2, w1, w2): M a = (f1 + brake, f2 - brake)."""
    g, (th1, th2, w1, w2) = mpf("9.81"), y
    c, s, brake = cos(th1 - th2), sin(th1 - th2), b * (w2 - w1)
    f1 = -s * w2**2 - 2 * g * sin(th1) + brake
    f2 = s * w1**2 - g * sin(th2) - brake
    det = 2 - c**2
    return [w1, w2, (f1 - c * f2) / det, (2 * f2 - c * f1) / det]


def solve(digits: int, start: Start, b: int, times: Sequence[str]) -> list[list[mpf]]:
    """States at the times [s]."""
    mp.dps = digits
    flow = odefun(lambda _, y: rate(y, b), 0, [*start(), mpf(0), mpf(0)])
    return [list(flow(mpf(t))) for t in times]


def motion(
    start: Start, times: Sequence[str], kept: int, precisions: tuple[int, int], b: int = 0
) -> Motion:  # fmt: skip
    """By time, to so many digits, on which both precisions agree."""
    rough, fine = (solve(digits, start, b, times) for digits in precisions)
    for one, other in zip(rough, fine, strict=True):
        assert max(abs(x - y) for x, y in zip(one, other, strict=True)) < mpf(10) ** -kept
    return {t: [nstr(x, max(kept, 16)) for x in y] for t, y in zip(times, fine, strict=True)}


def main() -> None:
    """Write both files."""
    free, about = "1 2 5 10".split(), "th1, th2 from the downward vertical [rad], w1, w2 [rad/s]; "
    double = {
        "about": about + "g 9.81 m/s^2",
        "pi6_pi4": motion(lambda: [pi / 6, pi / 4], free, 17, (22, 28)),
        "pi2_pi2": motion(lambda: [pi / 2, pi / 2], free[:3], 17, (22, 28)),
    }
    stiff = {
        "about": about + "elbow 1000 N m s/rad",
        "motion": motion(
            lambda: [pi / 2, pi / 2 - mpf("0.5")], ("0.5", "1"), 15, (18, 23), b=1000
        ),
    }
    for name, content in {"double_pendulum": double, "stiff_elbow": stiff}.items():
        Path(__file__).with_name(f"{name}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
