# SPDX-License-Identifier: Apache-2.0
"""Write the references with a closed form, computed with 30 or more digits, of which 20 are kept.

Where a formula is long, it is checked against a Taylor series of the equations of motion, or by a
difference. In SI units. Run: python make_closed_forms.py
"""

import json
from pathlib import Path

from mpmath import (
    acos,
    asin,
    atan2,
    cos,
    diff,
    ellipfun,
    ellipk,
    linspace,
    log,
    matrix,
    mp,
    mpf,
    nint,
    nstr,
    odefun,
    pi,
    polyroots,
    quad,
    sin,
    sqrt,
)


def digits(values: list[mpf]) -> list[str]:
    """Numbers as they are kept."""
    return [nstr(x, 20) for x in values]


def pendulum() -> dict[str, object]:
    """The plane pendulum released at rest from the horizontal.

    theta = 2 asin(k sn(K - sqrt(g/l) t | k²)), k = sin(45°), from the downward vertical (Landau
    and Lifshitz, Mechanics, §11; Jacobi's elliptic functions).
    """
    g, m = mpf("9.81"), mpf(1) / 2
    places = {}
    for t in (1, 2, 5, 10, 100, 2000):
        th = 2 * asin(sqrt(m) * ellipfun("sn", ellipk(m) - sqrt(g) * t, m=m))
        places[t] = digits([sin(th), -cos(th)])
    return {
        "about": "point mass 1 kg, rod 1 m, g 9.81 m/s^2, released at rest from x = +1 m; "
        "(x, z) of the mass [m]",
        "position": places,
        "period": nstr(4 * ellipk(m) / sqrt(g), 20),
    }


def coulomb() -> dict[str, object]:
    """A wheel that coasts to rest and a mass on a spring, with dry friction.

    Wheel: J w' = -Fc - b w from w0 stops at t = J/b ln(1 + b w0/Fc), after q = (J w0 - Fc t)/b.
    Mass: m x'' = -k x ∓ F is a harmonic motion about ∓F/k between turning points, half a period
    pi sqrt(m/k) apart, each 2 F/k nearer to zero than the one before; it stays where k |x| <= F
    first holds at a turning point (Den Hartog, Mechanical Vibrations, 1956).
    """
    J, Fc, b, w0 = map(mpf, ("0.1", "0.5", "0.2", "5"))
    t = J / b * log(1 + b * w0 / Fc)
    q = (J * w0 - Fc * t) / b
    series = odefun(lambda _, y: [y[1], -(Fc + b * y[1]) / J], 0, [mpf(0), w0])(t)
    assert abs(series[0] - q) + abs(series[1]) < mpf(10) ** -20
    m, k, F, x = map(mpf, ("1", "100", "1.5", "0.1"))
    turns = []
    while k * abs(x) > F:
        x = -(1 if x > 0 else -1) * (abs(x) - 2 * F / k)
        turns.append(x)
    return {
        "about": "wheel: 0.1 kg m^2, 0.5 N m, 0.2 N m s/rad, from 5 rad/s; "
        "mass: 1 kg, 100 N/m, 1.5 N, let go at 0.1 m; SI units",
        "coast_down": {"time": nstr(t, 20), "angle": nstr(q, 20)},
        "oscillator": {"half_period": nstr(pi * sqrt(m / k), 20), "turning_points": digits(turns)},
    }


def four_bar() -> dict[str, object]:
    """N four-bars in a row, in their one coordinate.

    Of 2N + 1 slender rods of 1 kg and 1 m, N + 1 turn with the angle th from the horizontal and N
    move as point masses at the tip: ((N+1)/3 + N) th'' = -g ((N+1)/2 + N) cos th, a pendulum with
    g c in place of g. Started upright at -1 rad/s it goes round for ever: with phi = th + pi/2,
    counted from the lowest position, phi'² = w² (1 - m sin²(phi/2)), so
    phi/2 = am(K(m) - w t/2 | m) with w² = 1 + 4 g c and m = 4 g c / w² (Jacobi's amplitude;
    Whittaker, A Treatise on the Analytical Dynamics of Particles and Rigid Bodies, §44).
    """
    content: dict[str, object] = {
        "about": "th [rad] from the horizontal and th' [rad/s]; 1 kg, 1 m, g 9.81 m/s^2; "
        "from pi/2 and -1"
    }
    for N in (1, 2):
        gc = mpf("9.81") * (mpf(N + 1) / 2 + N) / (mpf(N + 1) / 3 + N)
        w2 = 1 + 4 * gc
        m = 4 * gc / w2
        motion = {}
        for t in (1, 2, 5, 10, 20):
            u = ellipk(m) - sqrt(w2) * t / 2
            turns = nint(u / (2 * ellipk(m)))
            amplitude = turns * pi + asin(ellipfun("sn", u - 2 * turns * ellipk(m), m=m))
            motion[t] = [2 * amplitude - pi / 2, -sqrt(w2) * ellipfun("dn", u, m=m)]
        series = odefun(lambda _, y, gc=gc: [y[1], -gc * cos(y[0])], 0, [pi / 2, mpf(-1)])
        assert abs(motion[2][0] - series(2)[0]) < mpf(10) ** -20
        content[str(N)] = {t: digits(state) for t, state in motion.items()}
    return content


def spherical_pendulum() -> dict[str, object]:
    """A mass free to swing in two directions.

    With the height u = z / l (up is positive) the conserved energy and vertical angular momentum
    give u'² = (2 g / l) (u - u1)(u - u2)(u - u3), so u = u1 + (u2 - u1) sn²(w t + K | k²) when it
    starts at its highest point, w² = g (u3 - u1) / (2 l), k² = (u2 - u1) / (u3 - u1); the azimuth
    is the integral of L / (l² (1 - u²)) (Whittaker, §55).
    """
    g, u0, speed = mpf("9.81"), mpf("-0.5"), 2
    L, E = sqrt(1 - u0**2) * speed, mpf(speed) ** 2 / 2 + g * u0
    cubic = [2 * g, -2 * E, -2 * g, 2 * E - L**2]
    u1, u2, u3 = sorted(polyroots(cubic, maxsteps=200, extraprec=200))
    w, m = sqrt(g * (u3 - u1) / 2), (u2 - u1) / (u3 - u1)

    def u(time: mpf) -> mpf:
        return u1 + (u2 - u1) * ellipfun("sn", w * time + ellipk(m), m=m) ** 2

    def place(t: int) -> list[mpf]:
        azimuth = quad(lambda s: L / (1 - u(s) ** 2), linspace(0, t, 8 * t + 1))
        r = sqrt(1 - u(mpf(t)) ** 2)
        return [r * cos(azimuth), r * sin(azimuth), u(mpf(t))]

    def rate(_: mpf, y: list[mpf]) -> list[mpf]:
        """By Newton: gravity, and the rod's pull towards the pivot."""
        pull = y[3] ** 2 + y[4] ** 2 + y[5] ** 2 - g * y[2]
        return [y[3], y[4], y[5], -pull * y[0], -pull * y[1], -pull * y[2] - g]

    series = odefun(rate, 0, [sqrt(1 - u0**2), 0, u0, 0, mpf(speed), 0])(1)
    assert max(abs(a - b) for a, b in zip(place(1), series[:3], strict=True)) < mpf(10) ** -20
    return {
        "about": "1 kg on 1 m, g 9.81 m/s^2, from (sin 60 deg, 0, -0.5) m with (0, 2, 0) m/s; "
        "(x, y, z) in [m]",
        "position": {t: digits(place(t)) for t in (1, 2, 5, 10)},
    }


def free_top() -> dict[str, object]:
    """An asymmetric body that turns about its centre of mass.

    Landau and Lifshitz, Mechanics, §37: for I1 < I2 < I3 and L² > 2 E I2 the body rates are
    Jacobi's cn, sn and dn; the attitude is R = Rz(psi) Rx(theta) Rz(phi) in space axes with the
    angular momentum along z, where cos theta = I3 w3 / L, tan phi = I1 w1 / (I2 w2) and psi is an
    integral. That R' = R [w]x is checked by a high order difference.
    """
    inertia = ("0.02", "0.03", "0.04")
    (I1, I2, I3), L = map(mpf, inertia), mpf("0.19")
    E2, L2 = 2 * mpf("0.5"), L**2
    a, b = E2 * I3 - L2, L2 - E2 * I1
    m = (I2 - I1) * a / ((I3 - I2) * b)

    def rates(t: mpf) -> list[mpf]:
        s = t * sqrt((I3 - I2) * b / (I1 * I2 * I3))
        return [
            sqrt(a / (I1 * (I3 - I1))) * ellipfun("cn", s, m=m),
            sqrt(a / (I2 * (I3 - I2))) * ellipfun("sn", s, m=m),
            sqrt(b / (I3 * (I3 - I1))) * ellipfun("dn", s, m=m),
        ]

    def precession(t: mpf) -> mpf:
        w1, w2, _ = rates(t)
        return L * (I1 * w1**2 + I2 * w2**2) / ((I1 * w1) ** 2 + (I2 * w2) ** 2)

    def Rz(x: mpf) -> matrix:
        return matrix([[cos(x), -sin(x), 0], [sin(x), cos(x), 0], [0, 0, 1]])

    def Rx(x: mpf) -> matrix:
        return matrix([[1, 0, 0], [0, cos(x), -sin(x)], [0, sin(x), cos(x)]])

    def attitude(t: mpf) -> matrix:
        w1, w2, w3 = rates(t)
        psi = quad(precession, linspace(0, t, 1 + 10 * max(1, int(t)))) if t else mpf(0)
        return Rz(psi) * Rx(acos(I3 * w3 / L)) * Rz(atan2(I1 * w1, I2 * w2))

    t = mpf("0.37")
    slopes = [[diff(lambda s, i=i, j=j: attitude(s)[i, j], t) for j in range(3)] for i in range(3)]
    W = attitude(t).T * matrix(slopes)
    for turned, wanted in zip((W[2, 1], W[0, 2], W[1, 0]), rates(t), strict=True):
        assert abs(turned - wanted) < mpf(10) ** -10
    return {
        "about": "principal inertias [kg m^2], body rates [rad/s], "
        "rotation from body to space axes row by row",
        "inertia": inertia,
        "rates": {t: digits(rates(mpf(t))) for t in (0, 1, 2, 5, 10)},
        "attitude": {t: digits(attitude(mpf(t))) for t in (0, 1, 2, 5, 10)},
    }


PRECISION = {pendulum: 40, coulomb: 30, four_bar: 30, spherical_pendulum: 30, free_top: 30}


def main() -> None:
    """Write all of them."""
    for make, precision in PRECISION.items():
        mp.dps = precision
        text = json.dumps(make(), indent=1) + "\n"
        Path(__file__).with_name(f"{make.__name__}.json").write_text(text)


if __name__ == "__main__":
    main()
