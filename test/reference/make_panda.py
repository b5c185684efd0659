# SPDX-License-Identifier: Apache-2.0
"""Write panda.json: the Panda let go without friction, by Taylor series with 22 and 26 digits.

Masses and places of the links are those that Pinocchio reads from the URDF; the equations of
motion are Newton's and Euler's, recursively in link frames (Luh, Walker, Paul, J. Dyn. Syst. Meas.
Control 102, 1980), solved for the accelerations. Run: ./arm python test/reference/make_panda.py
(a quarter of an hour)
"""

import json
from dataclasses import dataclass
from pathlib import Path

from mpmath import cos, fabs, lu_solve, matrix, mp, mpf, nstr, odefun, sin

from arm_dynamics import ArmModel, load_scene

TIMES = ("0.25", "0.5", "1")
DIGITS = 15
Vector = list[mpf]


@dataclass
class Link:
    """A link that turns about z: where its joint sits on the one before, and what it weighs."""

    R: list[Vector]
    r: Vector
    mass: mpf
    com: Vector
    inertia: list[Vector]


def links() -> tuple[list[Link], list[float]]:
    """The chain, exactly as the doubles say, and where it starts [rad]."""
    scene = Path(__file__).parents[1] / "models/panda_free.yaml"
    model = ArmModel(load_scene(scene))
    pin, chain = model.pin, []
    for i in range(1, pin.njoints):
        assert pin.joints[i].shortname() == "JointModelRZ" and pin.parents[i] == i - 1
        place, body = pin.jointPlacements[i], pin.inertias[i]
        chain.append(
            Link(
                [vector(row) for row in place.rotation],
                vector(place.translation),
                mpf(float(body.mass)),
                vector(body.lever),
                [vector(row) for row in body.inertia],
            )
        )
    return chain, [float(x) for x in model.q0]


def vector(values: object) -> Vector:
    """Doubles as they are, but for the dirt of a right angle that pi in double leaves."""
    return [mpf(0) if abs(x) < 1e-12 else mpf(float(x)) for x in values]


def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def add(*terms: Vector) -> Vector:
    """Sum."""
    return [sum(parts) for parts in zip(*terms, strict=True)]


def times(A: list[Vector], x: Vector) -> Vector:
    """A x."""
    return [sum(a * b for a, b in zip(row, x, strict=True)) for row in A]


def turn(link: Link, q: mpf) -> list[Vector]:
    """Rotation from link to parent: R Rz(q)."""
    c, s = cos(q), sin(q)
    return [[a * c + b * s, b * c - a * s, z] for a, b, z in link.R]


def inverse(chain: list[Link], turns: list, v: Vector, a: Vector, g: mpf) -> Vector:
    """Torques [N m] for accelerations ``a`` under gravity ``g`` downwards."""
    w, dw, dv = [mpf(0)] * 3, [mpf(0)] * 3, [mpf(0), mpf(0), g]
    forces, moments = [], []
    for link, R, qd, qdd in zip(chain, turns, v, a, strict=True):
        back = [list(column) for column in zip(*R, strict=True)]
        dv = times(back, add(dv, cross(dw, link.r), cross(w, cross(w, link.r))))
        w, dw = times(back, w), times(back, dw)
        dw = add(dw, cross(w, [mpf(0), mpf(0), qd]), [mpf(0), mpf(0), qdd])
        w = add(w, [mpf(0), mpf(0), qd])
        ac = add(dv, cross(dw, link.com), cross(w, cross(w, link.com)))
        force = [link.mass * x for x in ac]
        forces.append(force)
        spin = add(times(link.inertia, dw), cross(w, times(link.inertia, w)))
        moments.append(add(spin, cross(link.com, force)))
    torques, f, m = [], [mpf(0)] * 3, [mpf(0)] * 3
    for i in reversed(range(len(chain))):
        f, m = add(f, forces[i]), add(m, moments[i])
        torques.append(m[2])
        f = times(turns[i], f)
        m = add(times(turns[i], m), cross(chain[i].r, f))
    return torques[::-1]


def forward(chain: list[Link], q: Vector, v: Vector) -> Vector:
    """Accelerations [rad/s²] without torque: a column of the inertia matrix for each joint."""
    n, zero = len(chain), [mpf(0)] * len(chain)
    turns = [turn(link, x) for link, x in zip(chain, q, strict=True)]
    bias = inverse(chain, turns, v, zero, mpf("9.81"))
    M = matrix(n, n)
    for j in range(n):
        unit = [mpf(i == j) for i in range(n)]
        for i, x in enumerate(inverse(chain, turns, zero, unit, mpf(0))):
            M[i, j] = x
    return list(lu_solve(M, matrix([-x for x in bias])))


def solve(digits: int) -> list[Vector]:
    """Positions [rad] and rates [rad/s] at the times."""
    mp.dps = digits
    chain, q0 = links()

    def rate(_: mpf, y: Vector) -> Vector:
        return [*y[7:], *forward(chain, y[:7], y[7:])]

    flow = odefun(rate, 0, [*map(mpf, q0), *[mpf(0)] * 7])
    return [list(flow(mpf(t))) for t in TIMES]


def main() -> None:
    """Solve with two precisions and compare."""
    rough, fine = solve(22), solve(26)
    worst = max(
        fabs(a - b) for x, y in zip(rough, fine, strict=True) for a, b in zip(x, y, strict=True)
    )
    assert worst < mpf(10) ** -DIGITS, f"the two runs differ by {nstr(worst, 3)}"
    content = {
        "about": "q [rad] and q' [rad/s] of the seven joints; no torque, no friction, "
        "g 9.81 m/s^2; from the scene's start",
        "motion": {
            t: {"q": [nstr(x, 18) for x in y[:7]], "v": [nstr(x, 18) for x in y[7:]]}
            for t, y in zip(TIMES, fine, strict=True)
        },
    }
    Path(__file__).with_name("panda.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
