# SPDX-License-Identifier: Apache-2.0
"""Write free_top.json: an asymmetric body that turns about its centre of mass, in closed form.

Landau and Lifshitz, Mechanics, §37: for I1 < I2 < I3 and L² > 2 E I2 the body rates are Jacobi's
cn, sn and dn; the attitude is R = Rz(psi) Rx(theta) Rz(phi) in space axes with the angular
momentum along z, where cos theta = I3 w3 / L, tan phi = I1 w1 / (I2 w2) and psi is an integral.
The script checks that R' = R [w]x by a high order difference. Run: python make_free_top.py
"""

import json
from pathlib import Path

from mpmath import (
    acos,
    atan2,
    cos,
    diff,
    ellipfun,
    linspace,
    matrix,
    mp,
    mpf,
    nstr,
    quad,
    sin,
    sqrt,
)

TIMES = (1, 2, 5, 10)
INERTIA = ("0.02", "0.03", "0.04")  # [kg m²]
ENERGY, MOMENTUM = "0.5", "0.19"  # [J], [kg m²/s]


def rates(t: mpf) -> list[mpf]:
    """Angular velocity in body axes in [rad/s]."""
    I1, I2, I3 = map(mpf, INERTIA)
    E2, L2 = 2 * mpf(ENERGY), mpf(MOMENTUM) ** 2
    a, b = E2 * I3 - L2, L2 - E2 * I1
    m = (I2 - I1) * a / ((I3 - I2) * b)
    s = t * sqrt((I3 - I2) * b / (I1 * I2 * I3))
    return [
        sqrt(a / (I1 * (I3 - I1))) * ellipfun("cn", s, m=m),
        sqrt(a / (I2 * (I3 - I2))) * ellipfun("sn", s, m=m),
        sqrt(b / (I3 * (I3 - I1))) * ellipfun("dn", s, m=m),
    ]


def precession(t: mpf) -> mpf:
    """Rate of psi in [rad/s]."""
    I1, I2, _ = map(mpf, INERTIA)
    w1, w2, _ = rates(t)
    return mpf(MOMENTUM) * (I1 * w1**2 + I2 * w2**2) / ((I1 * w1) ** 2 + (I2 * w2) ** 2)


def attitude(t: mpf) -> matrix:
    """Rotation from body to space axes."""
    I1, I2, I3 = map(mpf, INERTIA)
    w1, w2, w3 = rates(t)
    psi = quad(precession, linspace(0, t, 1 + 10 * max(1, int(t)))) if t else mpf(0)
    return Rz(psi) * Rx(acos(I3 * w3 / mpf(MOMENTUM))) * Rz(atan2(I1 * w1, I2 * w2))


def Rz(x: mpf) -> matrix:
    """Rotation about z."""
    return matrix([[cos(x), -sin(x), 0], [sin(x), cos(x), 0], [0, 0, 1]])


def Rx(x: mpf) -> matrix:
    """Rotation about x."""
    return matrix([[1, 0, 0], [0, cos(x), -sin(x)], [0, sin(x), cos(x)]])


def check(t: mpf) -> None:
    """The rates must be those with which the attitude turns."""
    R = attitude(t)
    dR = matrix(
        [[diff(lambda s, i=i, j=j: attitude(s)[i, j], t) for j in range(3)] for i in range(3)]
    )
    W = R.T * dR
    found = [W[2, 1], W[0, 2], W[1, 0]]
    worst = max(abs(a - b) for a, b in zip(found, rates(t), strict=True))
    assert worst < mpf(10) ** -10, f"attitude and rates disagree by {nstr(worst, 3)}"


def main() -> None:
    """Compute with 30 digits, keep 20."""
    mp.dps = 30
    check(mpf("0.37"))
    content = {
        "about": "principal inertias [kg m^2], body rates [rad/s], "
        "rotation from body to space axes row by row",
        "inertia": INERTIA,
        "rates": {t: [nstr(x, 20) for x in rates(mpf(t))] for t in (0, *TIMES)},
        "attitude": {t: [nstr(x, 20) for x in attitude(mpf(t))] for t in (0, *TIMES)},
    }
    Path(__file__).with_name("free_top.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
