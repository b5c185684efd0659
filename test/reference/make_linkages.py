# SPDX-License-Identifier: Apache-2.0
"""Write linkages.json: slider-crank and four-bar in their one coordinate, to 20 digits.

With the angles of all links and the places of their centres as functions of the crank angle th,
J th'' + J'/2 th'² + V' = tau - d th',  J = sum m |c'|² + I phi'²,  V = g sum m c_z
(primes on c, phi, J and V: derivatives by th). The equation is integrated by extrapolated midpoint
steps (Gragg, Bulirsch, Stoer; Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I,
1993, section II.9) of order 24 in 30 digits, with two step lengths that must agree. The force that
the last link before the cut exerts upon the other follows from Newton and Euler for single links,
without any multiplier. Points of the plane are complex numbers x + i z; numbers are those of a
context of mpmath's, ``mp`` or, in double precision, ``fp``. Run: python make_linkages.py
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpmath import fabs, mp, mpf, nstr

mp.dps = 30
TIMES = (1, 2, 5, 10)
SUBSTEPS = tuple(range(2, 26, 2))
State = tuple[mpf, mpf]


class Rod:
    """A slender rod: angle and place of its centre, with first and second derivatives by th."""

    def __init__(self, context: Any, length: str, mass: str, start: list, angle: list) -> None:
        length, self.mass, self.angle = context.mpf(length), context.mpf(mass), angle
        self.inertia = self.mass * length**2 / 12
        phi, phi1, phi2 = angle
        u = length * context.expj(phi)
        along = [u, 1j * phi1 * u, (1j * phi2 - phi1**2) * u]
        self.centre = [s + a / 2 for s, a in zip(start, along, strict=True)]
        self.end = [s + a for s, a in zip(start, along, strict=True)]


class Linkage:
    """A linkage whose crank turns about the origin, by th."""

    def __init__(self, context: Any = mp, gravity: str = "9.81") -> None:
        self.context, self.gravity = context, context.mpf(gravity)

    def links(self, th: mpf) -> list[Rod]:
        """The crank first."""
        raise NotImplementedError

    def point_masses(self, links: list[Rod]) -> list[tuple[mpf, list]]:
        """What moves besides rods."""
        return []

    def crank(self, length: str, mass: str, th: mpf) -> Rod:
        """The rod whose angle is th itself."""
        m = self.context
        return Rod(m, length, mass, [m.mpc(0)] * 3, [th, m.mpf(1), m.mpf(0)])

    def moment_about(self, rod: Rod, point: Any, rate: mpf, acc: mpf) -> mpf:
        """Moment about a point that forces other than weight must give the rod."""
        m = self.context
        a = accelerated(rod.centre, rate, acc) + 1j * self.gravity
        spin = rod.angle[2] * rate**2 + rod.angle[1] * acc
        return rod.inertia * spin + m.im(m.conj(rod.centre[0] - point) * a) * rod.mass

    def reduced(self, th: mpf, rate: mpf) -> tuple[mpf, mpf]:
        """J, and the torque on the crank that weight and the present motion exert."""
        m, links = self.context, self.links(th)
        masses = [(r.mass, r.centre) for r in links] + self.point_masses(links)
        J = sum(mass * m.re(m.conj(c[1]) * c[1]) for mass, c in masses)
        J += sum(r.inertia * r.angle[1] ** 2 for r in links)
        half = sum(mass * m.re(m.conj(c[1]) * c[2]) for mass, c in masses)
        half += sum(r.inertia * r.angle[1] * r.angle[2] for r in links)
        weight = self.gravity * sum(mass * m.im(c[1]) for mass, c in masses)
        return J, -half * rate**2 - weight


class SliderCrank(Linkage):
    """Crank 0.15 m and 0.5 kg, rod 0.4 m and 0.8 kg, slider 1 kg."""

    def links(self, th: mpf) -> list[Rod]:
        """Crank and rod; the rod ends on the rail."""
        m = self.context
        r, length = m.mpf("0.15"), m.mpf("0.4")
        beta = -m.asin(r * m.sin(th) / length)
        b1 = -r * m.cos(th) / (length * m.cos(beta))
        b2 = (r / length * m.sin(th) + m.sin(beta) * b1**2) / m.cos(beta)
        crank = self.crank("0.15", "0.5", th)
        return [crank, Rod(m, "0.4", "0.8", crank.end, [beta, b1, b2])]

    def point_masses(self, links: list[Rod]) -> list[tuple[mpf, list]]:
        """The slider moves with the end of the rod."""
        return [(self.context.mpf(1), links[1].end)]

    def force(self, links: list[Rod], rate: mpf, acc: mpf) -> Any:
        """Upon the slider: its inertia along the rail, and the moments about the crank's tip."""
        m, rod = self.context, links[1]
        along = m.re(accelerated(rod.end, rate, acc))
        lever = rod.end[0] - links[0].end[0]
        moment = self.moment_about(rod, links[0].end[0], rate, acc)
        # im(conj(lever) f) = moment of the force on the rod, which is -f.
        return m.mpc(along, (-moment + m.im(lever) * along) / m.re(lever))

    def joints(self, links: list[Rod], rate: mpf) -> tuple[list[mpf], list[mpf]]:
        """Positions and velocities: pivot, knuckle, rail."""
        re, (crank, rod) = self.context.re, links
        q = [crank.angle[0], rod.angle[0] - crank.angle[0], re(rod.end[0])]
        return q, [rate, rate * (rod.angle[1] - 1), rate * re(rod.end[1])]


class FourBar(Linkage):
    """Crank 0.1 m, coupler 0.3 m, rocker 0.25 m, 0.2, 0.6 and 0.5 kg, pivots 0.35 m apart."""

    def links(self, th: mpf) -> list[Rod]:
        """Crank, coupler and rocker, the rocker's tip above the coupler."""
        m = self.context
        b, c, d = m.mpf("0.3"), m.mpf("0.25"), m.mpf("0.35")
        crank = self.crank("0.1", "0.2", th)
        away = crank.end[0] - d
        s = m.fabs(away)
        psi = m.pi + m.arg(-away) - m.acos((c**2 + s**2 - b**2) / (2 * c * s))
        beta = m.arg(d + c * m.expj(psi) - crank.end[0])
        # Rates of both angles from a e^(i th) + b e^(i beta) = d + c e^(i psi), differentiated.
        u, w = b * m.expj(beta), c * m.expj(psi)
        b1, p1 = self._solved(1j * u, -1j * w, -crank.end[1])
        b2, p2 = self._solved(1j * u, -1j * w, -crank.end[2] + u * b1**2 - w * p1**2)
        coupler = Rod(m, "0.3", "0.6", crank.end, [beta, b1, b2])
        ground = [m.mpc(d), m.mpc(0), m.mpc(0)]
        return [crank, coupler, Rod(m, "0.25", "0.5", ground, [psi, p1, p2])]

    def _solved(self, u: Any, w: Any, b: Any) -> tuple[mpf, mpf]:
        """Real x, y of u x + w y = b."""
        re, im = self.context.re, self.context.im
        det = re(u) * im(w) - re(w) * im(u)
        return (re(b) * im(w) - re(w) * im(b)) / det, (re(u) * im(b) - re(b) * im(u)) / det

    def force(self, links: list[Rod], rate: mpf, acc: mpf) -> Any:
        """Upon the rocker, in its axes: moments about its pivot and the coupler's other end."""
        m, (crank, coupler, rocker) = self.context, links
        pivot = m.mpc(m.mpf("0.35"))
        lever_r, lever_c = rocker.end[0] - pivot, coupler.end[0] - crank.end[0]
        wanted_r = self.moment_about(rocker, pivot, rate, acc)
        wanted_c = -self.moment_about(coupler, crank.end[0], rate, acc)
        A = m.matrix([[-m.im(lever_r), m.re(lever_r)], [-m.im(lever_c), m.re(lever_c)]])
        x, z = m.lu_solve(A, m.matrix([wanted_r, wanted_c]))
        return m.mpc(x, z) * m.expj(-rocker.angle[0])

    def joints(self, links: list[Rod], rate: mpf) -> tuple[list[mpf], list[mpf]]:
        """Positions and velocities: crank_pivot, knee, rocker_pivot."""
        crank, coupler, rocker = links
        q = [crank.angle[0], coupler.angle[0] - crank.angle[0], rocker.angle[0]]
        return q, [rate, rate * (coupler.angle[1] - 1), rate * rocker.angle[1]]


def accelerated(place: list, rate: mpf, acc: mpf) -> Any:
    """Acceleration of a point."""
    return place[2] * rate**2 + place[1] * acc


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


def states(rate: Callable[[State], State], y: State, steps: int) -> dict[int, State]:
    """States at TIMES, with so many steps a second."""
    reached = {}
    for second in range(1, TIMES[-1] + 1):
        for _ in range(steps):
            y = extrapolated(rate, y, mpf(1) / steps)
        if second in TIMES:
            reached[second] = y
    return reached


def record(linkage: Linkage, rate: Callable[[State], State], y: State) -> dict[str, list[str]]:
    """Joint positions and velocities, and the force of the first frame upon the second."""
    links = linkage.links(y[0])
    q, v = linkage.joints(links, y[1])
    force = linkage.force(links, y[1], rate(y)[1])
    return {
        "q": [nstr(x, 20) for x in q],
        "v": [nstr(x, 20) for x in v],
        "force": [nstr(x, 17) for x in (mp.re(force), mpf(0), mp.im(force))],
    }


def main() -> None:
    """Integrate both with two step lengths and keep what they agree on."""
    content: dict[str, object] = {
        "about": "q, v in the order of the scene's joints [rad, m]; "
        "force upon the second frame, in its axes [N]"
    }
    # On the moon: on earth so small a four-bar is so fast that RK4 at 1 ms is not the better for
    # it. Linkage, start, torque, damping, steps a second.
    cases = {
        "slider_crank": (SliderCrank(), (mpf(1), mpf(8)), mpf("0.5"), mpf("0.05"), 120),
        "four_bar": (FourBar(mp, "1.62"), (mpf("0.5"), mpf(6)), mpf(0), mpf(0), 60),
    }
    for name, (linkage, start, torque, damping, steps) in cases.items():

        def rate(
            y: State, linkage: Linkage = linkage, torque: mpf = torque, d: mpf = damping
        ) -> State:
            J, force = linkage.reduced(*y)
            return y[1], (torque - d * y[1] + force) / J

        coarse, fine = states(rate, start, steps), states(rate, start, steps * 3 // 2)
        error = max(fabs(coarse[t][k] - fine[t][k]) for t in TIMES for k in (0, 1))
        print(name, "two step lengths differ by", nstr(error, 3))
        assert error < mpf(10) ** -17
        content[name] = {t: record(linkage, rate, y) for t, y in ({0: start} | fine).items()}
    Path(__file__).with_name("linkages.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
