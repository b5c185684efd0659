# SPDX-License-Identifier: Apache-2.0
"""Write coulomb.json: a wheel that coasts to rest and a mass on a spring, with dry friction.

Wheel: J w' = -Fc - b w from w0 stops at t = J/b ln(1 + b w0/Fc), after q = (J w0 - Fc t)/b.
Mass: m x'' = -k x ∓ F is a harmonic motion about ∓F/k between turning points, half a period
pi sqrt(m/k) apart, each 2 F/k nearer to zero than the one before; it stays where k |x| <= F first
holds at a turning point (Den Hartog, Mechanical Vibrations, 1956). Run: python make_coulomb.py
"""

import json
from pathlib import Path

from mpmath import log, mp, mpf, nstr, odefun, pi, sqrt

mp.dps = 30
J, FC, B, W0 = map(mpf, ("0.1", "0.5", "0.2", "5"))
M, K, F, X0 = map(mpf, ("1", "100", "1.5", "0.1"))


def coast_down() -> list[mpf]:
    """Time [s] and angle [rad] of the stop."""
    t = J / B * log(1 + B * W0 / FC)
    return [t, (J * W0 - FC * t) / B]


def turning_points() -> list[mpf]:
    """Places [m] where the mass turns, the last one being where it stays."""
    x, places = X0, []
    while K * abs(x) > F:
        x = -(1 if x > 0 else -1) * (abs(x) - 2 * F / K)
        places.append(x)
    return places


def main() -> None:
    """Check the stop by a Taylor series and keep 20 digits of 30."""
    t, q = coast_down()
    series = odefun(lambda _, y: [y[1], -(FC + B * y[1]) / J], 0, [mpf(0), W0])(t)
    assert abs(series[0] - q) + abs(series[1]) < mpf(10) ** -20
    content = {
        "about": "wheel: 0.1 kg m^2, 0.5 N m, 0.2 N m s/rad, from 5 rad/s; "
        "mass: 1 kg, 100 N/m, 1.5 N, let go at 0.1 m; SI units",
        "coast_down": {"time": nstr(t, 20), "angle": nstr(q, 20)},
        "oscillator": {
            "half_period": nstr(pi * sqrt(M / K), 20),
            "turning_points": [nstr(x, 20) for x in turning_points()],
        },
    }
    Path(__file__).with_name("coulomb.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
