# SPDX-License-Identifier: Apache-2.0
"""Random sets of joints and contacts that hold together, with their balance of forces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array

G = 9.81
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
RAILS = "xyz"


@dataclass(frozen=True)
class Cone:
    """A contact that touches: its force acts by columns of the balance.

    Attributes:
        columns: Generalized forces per normal force and per tangential force, shape (n, 2 or 3).
        friction: Coefficient of sliding friction.
        static: Coefficient of static friction.
    """

    columns: Array
    friction: float
    static: float


@dataclass(frozen=True)
class Set:
    """Parts that hold together under a load, which grows in a direction.

    At rest, weight + load + reactions of joints + constraints + contacts = 0.

    Attributes:
        kind: Its family.
        scene: The scene.
        names: The joints, in the order of all arrays.
        q: Positions, at which everything is at rest, shape (n,).
        weight: Generalized forces of gravity, shape (n,).
        base: Load at the factor 0, shape (n,).
        along: Load per unit of the factor, shape (n,).
        dry: Friction of the joints, sliding and static, zero without, shape (2, n).
        supports: Directions in which rigid stops bear joints: -1, 0 or 1, shape (n,).
        rows: Rows of the constraints, shape (m, n).
        cones: The contacts.
    """

    kind: str
    scene: dict[str, Any]
    names: tuple[str, ...]
    q: Array
    weight: Array
    base: Array
    along: Array
    dry: Array
    supports: Array
    rows: Array
    cones: tuple[Cone, ...] = field(default=())

    @property
    def indeterminate(self) -> bool:
        """Whether some combination of the reactions moves nothing."""
        held = np.eye(len(self.q))[:, (self.dry[1] > 0.0) | (self.supports != 0.0)]
        both = np.hstack([held, *(cone.columns for cone in self.cones)])
        free = np.linalg.svd(np.vstack([self.rows, np.zeros_like(self.q)]))
        rank = int(np.sum(free[1] > 1e-9))
        return both.shape[1] > np.linalg.matrix_rank(free[2][rank:] @ both, tol=1e-9)


def draw(seed: int, loads: int) -> Iterator[Set]:
    """Sets of one scene, which differ by their loads.

    Args:
        seed: Of the scene; its remainder determines the family.
        loads: Number of sets.
    """
    rng = np.random.default_rng(seed)
    family = FAMILIES[seed % len(FAMILIES)]
    make = family(rng)
    for _ in range(loads):
        yield make()


def _inertial(mass: float, moment: float) -> str:
    return (
        f'<inertial><mass value="{mass!r}"/><inertia ixx="{moment!r}" iyy="{moment!r}" '
        f'izz="{moment!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _joint(name: str, kind: str, parent: str, child: str, axis: Any, at: Any, limits: str) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{at[0]!r} {at[1]!r} {at[2]!r}"/>'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>{limits}</joint>'
    )


def _free(name: str, turns: str, mass: float, moment: float, lowest: str = "") -> str:
    """Links and joints of a body that moves along rails and turns.

    Args:
        name: Of the body and, with an axis, of its joints.
        turns: Axes of its rails, then in capitals those about which it turns.
        mass: In [kg].
        moment: Of inertia in [kg m²].
        lowest: Axis of the rail that has a stop at 0.
    """
    text, parent = "", "base"
    for k, axis in enumerate(turns):
        child = name if k == len(turns) - 1 else f"{name}_{axis}_rail"
        inside = _inertial(mass, moment) if child == name else ""
        slides = axis in RAILS
        lower = 0.0 if axis == lowest else -9.0
        limits = f'<limit lower="{lower}" upper="9" effort="0" velocity="0"/>' if slides else ""
        kind = "prismatic" if slides else "continuous"
        text += f'<link name="{child}">{inside}</link>'
        joint = f"{name}_{axis}"
        text += _joint(joint, kind, parent, child, AXES[axis.lower()], (0.0,) * 3, limits)
        parent = child
    return text


def _robot(*parts: str) -> dict[str, str]:
    return {"urdf": f'<robot name="set"><link name="base"/>{"".join(parts)}</robot>'}


def _levels(rng: np.random.Generator, low: float, high: float) -> tuple[float, float]:
    """Sliding and static level; equal in one of four."""
    sliding = float(rng.uniform(low, high))
    return sliding, sliding * (1.0 if rng.random() < 0.25 else float(rng.uniform(1.0, 2.5)))


def _friction(names: list[str], dry: Array) -> dict[str, Any]:
    rubs = {name: level for name, level in zip(names, dry.T.tolist(), strict=True) if level[1]}
    return {
        name: {"friction": {"coulomb": sliding, "static": static}}
        for name, (sliding, static) in rubs.items()
    }


def _touch(name: str, frame: str, point: Any, plane: dict[str, Any], mu: Any) -> dict[str, Any]:
    return {
        "type": "contact", "name": name, "frame": frame, "point": [float(p) for p in point],
        "plane": plane, "friction": mu[0], "static_friction": mu[1],
    }  # fmt: skip


def _planar(point: Any, normal: Any) -> Array:
    """Columns of a force on a body in the plane (x, z, turn about y): normal, tangential."""
    columns = []
    for fx, fz in ((normal[0], normal[1]), (-normal[1], normal[0])):
        columns.append([fx, fz, point[1] * fx - point[0] * fz])
    return np.array(columns).T


def _spatial(point: Any) -> Array:
    """Columns of a force on a body in space from a floor: normal z, then x and y."""
    p, forces = np.array(point), np.eye(3)[[2, 0, 1]]
    return np.array([[*f, *np.cross(p, f)] for f in forces]).T


def feet(rng: np.random.Generator) -> Callable[[], Set]:
    """A block on two to four feet, on steps and slopes, some of its rails with friction."""
    mass, count = rng.uniform(0.5, 5.0), int(rng.integers(2, 5))
    names, mu = ["b_x", "b_z", "b_Y"], [_levels(rng, 0.1, 0.8) for _ in range(count)]
    at = [(x, rng.uniform(-0.3, 0.3)) for x in np.sort(rng.uniform(-1.0, 1.0, count))]
    tilt = rng.uniform(-0.4, 0.4, count) * (rng.random() < 0.5)
    normal = [(np.sin(a), np.cos(a)) for a in tilt]
    dry = np.array([_levels(rng, 0.5, 3.0) for _ in names]).T * (rng.random(3) < 0.4)
    planes = [
        {"point": [x, 0.0, z], "normal": [n[0], 0.0, n[1]]}
        for (x, z), n in zip(at, normal, strict=True)
    ]
    scene = {
        "robot": _robot(_free("b", "xzY", mass, 0.3 * mass)),
        "joints": _friction(names, dry),
        "constraints": [
            _touch(f"foot_{k}", "b", (at[k][0], 0.0, at[k][1]), planes[k], mu[k])
            for k in range(count)
        ],
    }
    cones = [Cone(_planar(p, n), *m) for p, n, m in zip(at, normal, mu, strict=True)]
    weight = np.array([0.0, -mass * G, 0.0])

    def make() -> Set:
        along = rng.normal(size=3) * [1.0, 0.5, 0.3]
        press = np.array([0.0, -rng.uniform(0.0, 20.0), 0.0])
        return Set(
            "feet",
            scene,
            tuple(names),
            np.zeros(3),
            weight,
            press,
            along,
            dry,
            np.zeros(3),
            np.zeros((0, 3)),
            tuple(cones),
        )

    return make


def rails(rng: np.random.Generator) -> Callable[[], Set]:
    """A block on rails with friction, on a stop or a foot, or both."""
    mass, mu = rng.uniform(0.5, 5.0), _levels(rng, 0.1, 0.8)
    dry = np.array([_levels(rng, 0.5, 3.0) for _ in range(3)]).T
    stop = rng.random() < 0.5
    dry[:, 2] *= rng.random() < 0.7
    names = ["b_x", "b_y", "b_z"]
    scene = {
        "robot": _robot(_free("b", "xyz", mass, 1.0, "z" if stop else "")),
        "joints": _friction(names, dry),
        "constraints": [_touch("foot", "b", (0.0, 0.0, 0.0), {}, mu)],
    }
    columns = np.eye(3)[:, [2, 0, 1]]
    supports = np.array([0.0, 0.0, float(stop)])

    def make() -> Set:
        along = rng.normal(size=3) * [1.0, 1.0, 0.3]
        return Set(
            "rails",
            scene,
            tuple(names),
            np.zeros(3),
            np.array([0.0, 0.0, -mass * G]),
            np.zeros(3),
            along,
            dry,
            supports,
            np.zeros((0, 3)),
            (Cone(columns, *mu),),
        )

    return make


def loop(rng: np.random.Generator) -> Callable[[], Set]:
    """A chain of four or five bars, closed at a point, with friction in its hinges."""
    five = rng.random() < 0.5
    lengths, foot = rng.uniform(0.4, 1.2, 4 if five else 3), np.array([rng.uniform(0.2, 0.6), 0.0])
    count = len(lengths)
    names = [f"h{k}" for k in range(count)]
    text = ""
    for k, length in enumerate(lengths):
        starts = k in (0, 2)
        parent, at = ("base", (foot[0] if k == 2 else 0.0, 0.0, 0.0)) if starts else (
            f"bar{k - 1}", (float(lengths[k - 1]), 0.0, 0.0))  # fmt: skip
        text += f'<link name="bar{k}">{_inertial(float(length), 0.1)}</link>'
        at = tuple(float(x) for x in at)
        text += _joint(f"h{k}", "continuous", parent, f"bar{k}", (0, -1, 0), at, "")
    dry = np.array([_levels(rng, 0.3, 2.0) for _ in names]).T
    if rng.random() < 0.4:
        dry[:, rng.integers(count)] = 0.0
    ends = [[float(lengths[1]), 0.0, 0.0], [float(lengths[-1]), 0.0, 0.0]]
    start, _ = _closed(rng, lengths, foot)
    close = {"type": "point", "frames": ["bar1", f"bar{count - 1}"], "points": ends}
    scene = {
        "robot": _robot(text), "gravity": [0.0, 0.0, 0.0], "constraints": [close],
        "joints": _friction(names, dry),
        "initial": {"position": dict(zip(names, start.tolist(), strict=True))},
    }  # fmt: skip

    def make() -> Set:
        q, rows = _closed(rng, lengths, foot)
        along = rng.normal(size=count) * (rng.random(count) < 0.7)
        along[rng.integers(count)] += 1.0
        return Set(
            "loop",
            scene,
            tuple(names),
            q,
            np.zeros(count),
            np.zeros(count),
            along,
            dry,
            np.zeros(count),
            rows,
        )

    return make


def _closed(rng: np.random.Generator, lengths: Array, foot: Array) -> tuple[Array, Array]:
    """Positions of a closed chain of bars, and the rows of its constraint."""
    while True:
        free = rng.uniform(-np.pi, np.pi, 2)
        a, b = lengths[0], lengths[1]
        start = a * _unit(free[0])
        far = foot + (lengths[2] * _unit(free[1]) if len(lengths) == 4 else 0.0)
        c = lengths[-1]
        way = far - start
        d = float(np.hypot(*way))
        if not abs(b - c) + 0.05 < d < b + c - 0.05:
            continue
        inner = np.arccos((b**2 + d**2 - c**2) / (2 * b * d))
        of_b = np.arctan2(way[1], way[0]) + inner
        end = start + b * _unit(of_b)
        of_c = np.arctan2(*(end - far)[::-1])
        turned = [_unit(x + np.pi / 2) for x in (free[0], of_b, of_c)]
        if len(lengths) == 3:
            rows = [a * turned[0] + b * turned[1], b * turned[1], -c * turned[2]]
            return np.array([free[0], of_b - free[0], of_c]), np.array(rows).T
        third = lengths[2] * _unit(free[1] + np.pi / 2)
        rows = [a * turned[0] + b * turned[1], b * turned[1], -third - c * turned[2],
                -c * turned[2]]  # fmt: skip
        return np.array([free[0], of_b - free[0], free[1], of_c - free[1]]), np.array(rows).T


def _unit(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def couplings(rng: np.random.Generator) -> Callable[[], Set]:
    """Wheels coupled by gears, with friction at each; in half of them, two trains."""
    count = int(rng.integers(3, 7))
    names = [f"w{k}" for k in range(count)]
    text = "".join(
        f'<link name="wheel{k}">{_inertial(1.0, float(rng.uniform(0.05, 1.0)))}</link>'
        + _joint(f"w{k}", "continuous", "base", f"wheel{k}", (0, 0, 1), (0.0, 0.0, 0.0), "")
        for k in range(count)
    )
    cut = count // 2 if rng.random() < 0.5 and count > 3 else 0
    rows, gears = np.zeros((0, count)), []
    for k in range(1, count):
        if k == cut:
            continue
        lead, ratio = (
            (cut if cut and k > cut else 0),
            float(rng.choice([-1, 1]) * rng.uniform(0.3, 3)),
        )
        gears.append({"type": "coupling", "joints": [f"w{k}", f"w{lead}"], "ratio": ratio})
        row = np.zeros(count)
        row[[k, lead]] = 1.0, -ratio
        rows = np.vstack([rows, row])
    dry = np.array([_levels(rng, 0.3, 2.0) for _ in names]).T
    scene = {"robot": _robot(text), "constraints": gears, "joints": _friction(names, dry)}

    def make() -> Set:
        along = rng.normal(size=count)
        return Set(
            "couplings",
            scene,
            tuple(names),
            np.zeros(count),
            np.zeros(count),
            np.zeros(count),
            along,
            dry,
            np.zeros(count),
            rows,
        )

    return make


def grasp(rng: np.random.Generator) -> Callable[[], Set]:
    """Two fingers with friction that hold a box by one or two points each."""
    mass, half = rng.uniform(0.2, 2.0), rng.uniform(0.1, 0.4)
    dry = np.zeros((2, 5))
    dry[:, 3:] = np.array([_levels(rng, 0.5, 3.0) for _ in range(2)]).T
    if rng.random() < 0.3:
        dry[:, 4] = 0.0
    names = ["b_x", "b_z", "b_Y", "l_x", "r_x"]
    touches, cones = [], []
    for side, (finger, way) in enumerate((("l", -1.0), ("r", 1.0))):
        for k in range(int(rng.integers(1, 3))):
            z, mu = float(rng.uniform(-0.2, 0.2)), _levels(rng, 0.2, 0.9)
            plane = {"frame": "b", "point": [way * half, 0.0, 0.0], "normal": [way, 0.0, 0.0]}
            point = (way * half, 0.0, z)
            touches.append(_touch(f"{finger}{k}", finger, point, plane, mu))
            box = -_planar((way * half, z), (way, 0.0))
            cones.append(Cone(np.vstack([box, np.eye(2)[:, [side]] * [[way, 0.0]]]), *mu))
    text = (
        _free("b", "xzY", mass, 0.02 * mass),
        _free("l", "x", 0.3, 1.0),
        _free("r", "x", 0.3, 1.0),
    )
    scene = {"robot": _robot(*text), "joints": _friction(names, dry), "constraints": touches}
    weight = np.array([0.0, -mass * G, 0.0, 0.0, 0.0])

    def make() -> Set:
        squeeze = rng.uniform(1.5, 6.0) * mass * G
        base = np.array([0.0, 0.0, 0.0, squeeze, -squeeze])
        along = rng.normal(size=5) * [1.0, 1.0, 0.1, 0.3, 0.3]
        return Set(
            "grasp",
            scene,
            tuple(names),
            np.zeros(5),
            weight,
            base,
            along,
            dry,
            np.zeros(5),
            np.zeros((0, 5)),
            tuple(cones),
        )

    return make


def table(rng: np.random.Generator) -> Callable[[], Set]:
    """A body in space on three or four feet, pushed and turned: cones, not pyramids."""
    mass, count = rng.uniform(0.5, 5.0), int(rng.integers(3, 5))
    angle = 2 * np.pi * (np.arange(count) + rng.uniform(0.0, 0.7, count)) / count
    at = np.c_[np.cos(angle), np.sin(angle), 0 * angle] * rng.uniform(0.3, 1.0, (count, 1))
    mu = [_levels(rng, 0.1, 0.8) for _ in range(count)]
    scene = {
        "robot": _robot(_free("b", "xyzXYZ", mass, 0.3 * mass)),
        "constraints": [_touch(f"foot_{k}", "b", at[k], {}, mu[k]) for k in range(count)],
    }
    names = [f"b_{axis}" for axis in "xyzXYZ"]
    cones = tuple(Cone(_spatial(p), *m) for p, m in zip(at, mu, strict=True))
    weight = np.array([0.0, 0.0, -mass * G, 0.0, 0.0, 0.0])

    def make() -> Set:
        along = rng.normal(size=6) * [1.0, 1.0, 0.3, 0.1, 0.1, 0.5]
        return Set(
            "table",
            scene,
            tuple(names),
            np.zeros(6),
            weight,
            np.zeros(6),
            along,
            np.zeros((2, 6)),
            np.zeros(6),
            np.zeros((0, 6)),
            cones,
        )

    return make


FAMILIES = (feet, rails, loop, couplings, grasp, table)
