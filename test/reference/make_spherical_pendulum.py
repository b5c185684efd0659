# SPDX-License-Identifier: Apache-2.0
"""Write spherical_pendulum.json: a mass free to swing in two directions, in closed form.

With the height u = z / l (up is positive) the conserved energy and vertical angular momentum give
u'² = (2 g / l) (u - u1)(u - u2)(u - u3), so u = u1 + (u2 - u1) sn²(w t + K | k²) when it starts at
its highest point, w² = g (u3 - u1) / (2 l), k² = (u2 - u1) / (u3 - u1); the azimuth is the
integral of L / (l² (1 - u²)) (Whittaker, A Treatise on the Analytical Dynamics of Particles and
Rigid Bodies, §55). The script checks it against a Taylor series solution of the equations of
motion. Run: python make_spherical_pendulum.py
"""

import json
from pathlib import Path

from mpmath import (
    cos,
    ellipfun,
    ellipk,
    fabs,
    linspace,
    mp,
    mpf,
    nstr,
    odefun,
    polyroots,
    quad,
    sin,
    sqrt,
)

TIMES = (1, 2, 5, 10)
G, HEIGHT, SPEED = (
    "9.81",
    "-0.5",
    2,
)  # start at u = -0.5 (60° from the vertical), horizontal speed [m/s]


def closed_form(t: int) -> list[mpf]:
    """Position (x, y, z) of the mass in [m] at time t [s], rod of 1 m."""
    g, u0 = mpf(G), mpf(HEIGHT)
    L, E = sqrt(1 - u0**2) * SPEED, mpf(SPEED) ** 2 / 2 + g * u0
    u1, u2, u3 = sorted(
        polyroots([2 * g, -2 * E, -2 * g, 2 * E - L**2], maxsteps=200, extraprec=200)
    )
    w, m = sqrt(g * (u3 - u1) / 2), (u2 - u1) / (u3 - u1)
    K = ellipk(m)

    def u(time: mpf) -> mpf:
        return u1 + (u2 - u1) * ellipfun("sn", w * time + K, m=m) ** 2

    azimuth = quad(lambda s: L / (1 - u(s) ** 2), linspace(0, t, 8 * t + 1))
    r = sqrt(1 - u(mpf(t)) ** 2)
    return [r * cos(azimuth), r * sin(azimuth), u(mpf(t))]


def by_series(t: int) -> list[mpf]:
    """The same from Newton's law: acceleration by gravity and the rod's pull towards the pivot."""
    g, u0 = mpf(G), mpf(HEIGHT)

    def rate(_: mpf, y: list[mpf]) -> list[mpf]:
        pull = y[3] ** 2 + y[4] ** 2 + y[5] ** 2 - g * y[2]
        return [y[3], y[4], y[5], -pull * y[0], -pull * y[1], -pull * y[2] - g]

    return list(odefun(rate, 0, [sqrt(1 - u0**2), 0, u0, 0, mpf(SPEED), 0])(t)[:3])


def main() -> None:
    """Compute with 30 digits, check at 1 s, keep 20."""
    mp.dps = 30
    places = {t: closed_form(t) for t in TIMES}
    worst = max(fabs(a - b) for a, b in zip(places[1], by_series(1), strict=True))
    assert worst < mpf(10) ** -20, f"closed form and series differ by {nstr(worst, 3)}"
    content = {
        "about": "1 kg on 1 m, g 9.81 m/s^2, from (sin 60 deg, 0, -0.5) m with (0, 2, 0) m/s; "
        "(x, y, z) in [m]",
        "position": {t: [nstr(x, 20) for x in place] for t, place in places.items()},
    }
    Path(__file__).with_name("spherical_pendulum.json").write_text(
        json.dumps(content, indent=1) + "\n"
    )


if __name__ == "__main__":
    main()
