# SPDX-License-Identifier: Apache-2.0
"""Write linkages.json: slider-crank and four-bar in their one coordinate, to 20 digits.

With the angles of all links and the places of their centres as functions of the crank angle th,
J th'' + J'/2 th'² + V' = tau - d th',  J = sum m |c'|² + I phi'²,  V = g sum m c_z
(primes on c, phi, J and V: derivatives by th). The equation is integrated by extrapolated midpoint
steps (Gragg, Bulirsch, Stoer; Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I,
1993, section II.9) of order 24 in 30 digits, with two step lengths that must agree. The force that
the last link before the cut exerts upon the other follows from Newton and Euler for single links,
without any multiplier. Points of the plane are complex numbers x + i z. Run: python
make_linkages.py
"""

import json
from collections.abc import Callable
from pathlib import Path

from mpmath import (
    acos,
    arg,
    asin,
    conj,
    cos,
    expj,
    fabs,
    im,
    lu_solve,
    matrix,
    mp,
    mpc,
    mpf,
    nstr,
    pi,
    re,
    sin,
)

mp.dps = 30
TIMES = (1, 2, 5, 10)
SUBSTEPS = tuple(range(2, 26, 2))
State = tuple[mpf, mpf]


class Rod:
    """A slender rod: angle and place of its centre, with first and second derivatives by th."""

    def __init__(self, length: mpf, mass: mpf, start: list[mpc], angle: list[mpf]) -> None:
        self.length, self.mass, self.angle = length, mass, angle
        self.inertia = mass * length**2 / 12
        phi, phi1, phi2 = angle
        u = length * expj(phi)
        along = [u, 1j * phi1 * u, (1j * phi2 - phi1**2) * u]
        self.centre = [s + a / 2 for s, a in zip(start, along, strict=True)]
        self.end = [s + a for s, a in zip(start, along, strict=True)]


def crank_of(length: mpf, mass: mpf, th: mpf) -> Rod:
    """The rod whose angle is th itself, about the origin."""
    return Rod(length, mass, [mpc(0)] * 3, [th, mpf(1), mpf(0)])


class SliderCrank:
    """Crank 0.15 m and 0.5 kg, rod 0.4 m and 0.8 kg, slider 1 kg."""

    start, torque, damping = (mpf(1), mpf(8)), mpf("0.5"), mpf("0.05")
    gravity, slider = mpf("9.81"), mpf(1)

    def links(self, th: mpf) -> list[Rod]:
        """Crank and rod; the rod ends on the rail."""
        r, length = mpf("0.15"), mpf("0.4")
        beta = -asin(r * sin(th) / length)
        b1 = -r * cos(th) / (length * cos(beta))
        b2 = (r / length * sin(th) + sin(beta) * b1**2) / cos(beta)
        crank = crank_of(r, mpf("0.5"), th)
        return [crank, Rod(length, mpf("0.8"), crank.end, [beta, b1, b2])]

    def point_masses(self, links: list[Rod]) -> list[tuple[mpf, list[mpc]]]:
        """The slider moves with the end of the rod."""
        return [(self.slider, links[1].end)]

    def force(self, links: list[Rod], rate: mpf, acc: mpf) -> mpc:
        """Upon the slider: its inertia along the rail, and the moments about the crank's tip."""
        rod = links[1]
        along = self.slider * re(accelerated(rod.end, rate, acc))
        lever, moment = (
            rod.end[0] - links[0].end[0],
            moment_about(rod, links[0].end[0], rate, acc, self.gravity),
        )
        # im(conj(lever) f) = moment of the force on the rod, which is -f.
        return mpc(along, (-moment + im(lever) * along) / re(lever))

    def joints(self, links: list[Rod], rate: mpf) -> tuple[list[mpf], list[mpf]]:
        """Positions and velocities: pivot, knuckle, rail."""
        crank, rod = links
        q = [crank.angle[0], rod.angle[0] - crank.angle[0], re(rod.end[0])]
        return q, [rate, rate * (rod.angle[1] - 1), rate * re(rod.end[1])]


class FourBar:
    """Crank 0.1 m, coupler 0.3 m, rocker 0.25 m, 0.2, 0.6 and 0.5 kg, pivots 0.35 m apart.

    On the moon: on earth so small a linkage is so fast that RK4 at 1 ms is not the better for it.
    """

    start, torque, damping = (mpf("0.5"), mpf(6)), mpf(0), mpf(0)
    gravity = mpf("1.62")

    def links(self, th: mpf) -> list[Rod]:
        """Crank, coupler and rocker, the rocker's tip above the coupler."""
        a, b, c, d = mpf("0.1"), mpf("0.3"), mpf("0.25"), mpf("0.35")
        crank = crank_of(a, mpf("0.2"), th)
        away = crank.end[0] - d
        s = fabs(away)
        psi = pi + arg(-away) - acos((c**2 + s**2 - b**2) / (2 * c * s))
        beta = arg(d + c * expj(psi) - crank.end[0])
        # Rates of both angles from a e^(i th) + b e^(i beta) = d + c e^(i psi), differentiated.
        u, w = b * expj(beta), c * expj(psi)
        b1, p1 = solved(1j * u, -1j * w, -crank.end[1])
        b2, p2 = solved(1j * u, -1j * w, -crank.end[2] + u * b1**2 - w * p1**2)
        coupler = Rod(b, mpf("0.6"), crank.end, [beta, b1, b2])
        return [crank, coupler, Rod(c, mpf("0.5"), [mpc(d), mpc(0), mpc(0)], [psi, p1, p2])]

    def point_masses(self, links: list[Rod]) -> list[tuple[mpf, list[mpc]]]:
        """None."""
        return []

    def force(self, links: list[Rod], rate: mpf, acc: mpf) -> mpc:
        """Upon the rocker, in its axes: moments about its pivot and the coupler's other end."""
        crank, coupler, rocker = links
        pivot = mpc(mpf("0.35"))
        lever_r, lever_c = rocker.end[0] - pivot, coupler.end[0] - crank.end[0]
        wanted_r = moment_about(rocker, pivot, rate, acc, self.gravity)
        wanted_c = -moment_about(coupler, crank.end[0], rate, acc, self.gravity)
        A = matrix([[-im(lever_r), re(lever_r)], [-im(lever_c), re(lever_c)]])
        x, z = lu_solve(A, matrix([wanted_r, wanted_c]))
        return mpc(x, z) * expj(-rocker.angle[0])

    def joints(self, links: list[Rod], rate: mpf) -> tuple[list[mpf], list[mpf]]:
        """Positions and velocities: crank_pivot, knee, rocker_pivot."""
        crank, coupler, rocker = links
        q = [crank.angle[0], coupler.angle[0] - crank.angle[0], rocker.angle[0]]
        return q, [rate, rate * (coupler.angle[1] - 1), rate * rocker.angle[1]]


def solved(u: mpc, w: mpc, b: mpc) -> tuple[mpf, mpf]:
    """Real x, y of u x + w y = b."""
    det = re(u) * im(w) - re(w) * im(u)
    return (re(b) * im(w) - re(w) * im(b)) / det, (re(u) * im(b) - re(b) * im(u)) / det


def accelerated(place: list[mpc], rate: mpf, acc: mpf) -> mpc:
    """Acceleration of a point."""
    return place[2] * rate**2 + place[1] * acc


def moment_about(rod: Rod, point: mpc, rate: mpf, acc: mpf, g: mpf) -> mpf:
    """Moment about a point that forces other than weight must give the rod."""
    a = accelerated(rod.centre, rate, acc) + 1j * g
    spin = rod.angle[2] * rate**2 + rod.angle[1] * acc
    return rod.inertia * spin + im(conj(rod.centre[0] - point) * a) * rod.mass


def acceleration(system: SliderCrank | FourBar, th: mpf, rate: mpf) -> mpf:
    """th'' from the reduced equation."""
    links = system.links(th)
    masses = [(r.mass, r.centre) for r in links] + system.point_masses(links)
    J = sum(m * re(conj(c[1]) * c[1]) for m, c in masses)
    J += sum(r.inertia * r.angle[1] ** 2 for r in links)
    half = sum(m * re(conj(c[1]) * c[2]) for m, c in masses)
    half += sum(r.inertia * r.angle[1] * r.angle[2] for r in links)
    weight = system.gravity * sum(m * im(c[1]) for m, c in masses)
    return (system.torque - system.damping * rate - half * rate**2 - weight) / J


def extrapolated(f: Callable[[State], State], y: State, H: mpf) -> State:
    """One step of length H."""
    table: list[State] = []
    for j, n in enumerate(SUBSTEPS):
        h, before = H / n, y
        now = added(y, f(y), h)
        for _ in range(n - 1):
            before, now = now, added(before, f(now), 2 * h)
        above, table = table, [now]
        for k in range(j):
            ratio = mpf(n) / SUBSTEPS[j - k - 1]
            low, high = above[k], table[k]
            table.append(
                tuple(b + (b - a) / (ratio**2 - 1) for a, b in zip(low, high, strict=True))
            )
    return table[-1]


def added(y: State, slope: State, h: mpf) -> State:
    """y + h slope."""
    return y[0] + h * slope[0], y[1] + h * slope[1]


def states(system: SliderCrank | FourBar, steps: int) -> dict[int, State]:
    """States at TIMES, with so many steps a second."""
    y, found = system.start, {}
    for second in range(1, TIMES[-1] + 1):
        for _ in range(steps):
            y = extrapolated(lambda s: (s[1], acceleration(system, *s)), y, mpf(1) / steps)
        if second in TIMES:
            found[second] = y
    return found


def record(system: SliderCrank | FourBar, y: State) -> dict[str, list[str]]:
    """Joint positions and velocities, and the force of the first frame upon the second."""
    links, acc = system.links(y[0]), acceleration(system, *y)
    q, v = system.joints(links, y[1])
    force = system.force(links, y[1], acc)
    return {
        "q": [nstr(x, 20) for x in q],
        "v": [nstr(x, 20) for x in v],
        "force": [nstr(x, 17) for x in (re(force), mpf(0), im(force))],
    }


def main() -> None:
    """Integrate both with two step lengths and keep what they agree on."""
    content: dict[str, object] = {
        "about": "q, v in the order of the scene's joints [rad, m]; "
        "force upon the second frame, in its axes [N]"
    }
    for name, system, steps in (("slider_crank", SliderCrank(), 120), ("four_bar", FourBar(), 60)):
        coarse, fine = states(system, steps), states(system, steps * 3 // 2)
        error = max(fabs(coarse[t][k] - fine[t][k]) for t in TIMES for k in (0, 1))
        print(name, "two step lengths differ by", nstr(error, 3))
        assert error < mpf(10) ** -17
        content[name] = {0: record(system, system.start)} | {
            t: record(system, fine[t]) for t in TIMES
        }
    Path(__file__).with_name("linkages.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
