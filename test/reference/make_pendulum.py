# SPDX-License-Identifier: Apache-2.0
"""Write pendulum.json: the plane pendulum released at rest from the horizontal, in closed form.

theta = 2 asin(k sn(K - sqrt(g/l) t | k²)), k = sin(45°), from the downward vertical (Landau and
Lifshitz, Mechanics, §11; Jacobi's elliptic functions). Run: python make_pendulum.py
"""

import json
from pathlib import Path

from mpmath import asin, cos, ellipfun, ellipk, mp, mpf, nstr, sin, sqrt

TIMES = (1, 2, 5, 10, 100, 2000)


def angle(t: int, g: mpf) -> mpf:
    """Angle from the downward vertical at time t [s] in [rad], for a rod of 1 m."""
    m = mpf(1) / 2
    return 2 * asin(sqrt(m) * ellipfun("sn", ellipk(m) - sqrt(g) * t, m=m))


def main() -> None:
    """Compute with 40 digits and keep 20."""
    mp.dps = 40
    g = mpf("9.81")
    angles = {t: angle(t, g) for t in TIMES}
    content = {
        "about": "point mass 1 kg, rod 1 m, g 9.81 m/s^2, released at rest from x = +1 m; "
        "(x, z) of the mass [m]",
        "position": {t: [nstr(sin(th), 20), nstr(-cos(th), 20)] for t, th in angles.items()},
        "period": nstr(4 * ellipk(mpf(1) / 2) / sqrt(g), 20),
    }
    Path(__file__).with_name("pendulum.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
