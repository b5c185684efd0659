# SPDX-License-Identifier: Apache-2.0
"""Write stiff_elbow.json: a double pendulum with a very viscous elbow, by Taylor series.

Equations of motion as in make_double_pendulum.py, with the torque -b (w2 - w1) at the elbow, from
rest at th1 = 90°, th2 = 90° - 0.5 rad. Every value is computed twice, with different precision.
Run: python make_stiff_elbow.py (a few minutes)
"""

import json
from pathlib import Path

from make_double_pendulum import rate
from mpmath import cos, fabs, mp, mpf, nstr, odefun, pi

TIMES = ("0.5", "1")
VISCOUS = 1000
DIGITS = 15


def braked(t: mpf, y: list[mpf]) -> list[mpf]:
    """Time derivative of (th1, th2, w1, w2): M a = tau_gravity,centrifugal + (brake, -brake)."""
    th1, th2, w1, w2 = y
    c, brake = cos(th1 - th2), VISCOUS * (w2 - w1)
    _, _, a1, a2 = rate(t, y)
    det = 2 - c**2
    return [w1, w2, a1 + (1 + c) * brake / det, a2 - (2 + c) * brake / det]


def solve(digits: int) -> list[list[mpf]]:
    """States at the times [s]."""
    mp.dps = digits
    flow = odefun(braked, 0, [pi / 2, pi / 2 - mpf("0.5"), mpf(0), mpf(0)])
    return [list(flow(mpf(t))) for t in TIMES]


def main() -> None:
    """Solve at two precisions and compare."""
    rough, fine = solve(18), solve(23)
    worst = max(
        fabs(a - b) for x, y in zip(rough, fine, strict=True) for a, b in zip(x, y, strict=True)
    )
    assert worst < mpf(10) ** -DIGITS, f"the two runs differ by {nstr(worst, 3)}"
    content = {
        "about": "th1, th2 from the downward vertical [rad], w1, w2 [rad/s]; elbow 1000 N m s/rad",
        "motion": {t: [nstr(x, DIGITS + 1) for x in y] for t, y in zip(TIMES, fine, strict=True)},
    }
    Path(__file__).with_name("stiff_elbow.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
