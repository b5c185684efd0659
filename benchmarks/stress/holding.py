# SPDX-License-Identifier: Apache-2.0
"""Loads at which the simulator and ``Dynamics`` let sets go, and whether the motion obeys.

The balance of forces is written down from Jacobians and gravity, the limits by linear programs.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any
from xml.etree import ElementTree

import numpy as np

from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.arrays import Array
from arm_sim import SimulationDiverged, Simulator
from benchmarks.reporting.markdown import number, table
from benchmarks.stress.limits import Cone, Set, lacking, limit
from benchmarks.stress.scenes import held

LOADS = 5  # sets of a scene, which differ by their loads
WITHIN = 1e-6  # largest error of a load, relative
BISECTIONS = 40
BEYOND = (1.0001, 1.01, 1.3, 2.0)  # multiples of the limit at which the motion is checked
TICK = 1e-6  # [s], after which velocities are read as accelerations
ROUNDING = 1e-9  # accelerations that are rest [m/s² or rad/s²]
NOTHING = 1e-12  # a column of a direction in which a body cannot move


@dataclass(frozen=True)
class Held:
    """One set."""

    family: str  # of its scene
    seed: int  # of its scene
    limit: float  # factor of its load at which it gives way, by a linear program
    error: float  # of the simulator's factor, relative; infinite if a tick could not be computed
    of_dynamics: float | None  # of that of ``constrained_forward``, likewise; None with contacts
    # How far motions beyond it are from obeying the laws, relative. Where sliding contacts are
    # redundant themselves, several motions obey, and a tick may mix them.
    lacking: float

    @property
    def good(self) -> bool:
        """Whether the limits are met, and there is a motion beyond them."""
        return max(self.error, self.of_dynamics or 0.0) <= WITHIN and np.isfinite(self.lacking)


def measured(seed: int) -> Iterator[Held]:
    """Measure set after set; those that are determinate, jam or do not hold are left out."""
    for number_of in count(seed):
        family, scene = held(number_of)
        rng = np.random.default_rng([number_of, 1])
        sim = Simulator(scene, integrator="rk4", dt=TICK)
        for _ in range(LOADS):
            each = balance(sim, scene, rng)
            at = limit(each)
            if each.indeterminate and np.isfinite(at):
                yield _measured(each, family, number_of, at, sim)


def balance(sim: Simulator, scene: dict[str, Any], rng: np.random.Generator) -> Set:
    """The balance of forces at a simulator's start, with a random load."""
    q, names, dynamics = np.array(sim.reset().q), list(sim.joint_names), sim.dynamics
    levels = [scene["joints"].get(name, {}).get("friction", {}) for name in names]
    dry = np.array([[level.get(key, 0.0) for level in levels] for key in ("coulomb", "static")])
    joints = {str(e.get("name")): e for e in ElementTree.fromstring(scene["robot"]["urdf"])}
    stops = [joints[name].find('limit[@lower="0.0"]') is not None for name in names]
    base, weight = np.zeros(len(names)), -np.array(dynamics.gravity(q))
    if "l_x" in names:  # fingers press on what they hold
        press = rng.uniform(3.0, 12.0) * abs(weight).max()
        base[[names.index("l_x"), names.index("r_x")]] = press, -press
    size = np.array([1.0 if name[-1] in "xyz" else 0.4 for name in names])
    along = size * rng.normal(size=len(names)) * (rng.random(len(names)) < 0.8)
    along[rng.integers(len(names))] += 1.0
    rows, cones = [np.zeros((0, len(names)))], []
    for constraint in scene.get("constraints", ()):
        if constraint["type"] == "coupling":
            own = np.zeros((1, len(names)))
            own[0, [names.index(name) for name in constraint["joints"]]] = 1, -constraint["ratio"]
            rows.append(own)
        elif constraint["type"] == "point":
            frame, point = constraint["frames"][0], constraint["points"][0]
            rows.append(_moving(_point(dynamics, q, frame, _place(dynamics, q, frame, point))))
        else:
            columns = _moving(_apart(dynamics, q, constraint)).T
            cones.append(Cone(columns, constraint["friction"], constraint["static_friction"]))
    return Set(
        weight, base, along, dry, np.array(stops, dtype=float),
        np.vstack(rows), tuple(cones),
    )  # fmt: skip


def _place(dynamics: Dynamics, q: Array, frame: str, point: Sequence[float]) -> Array:
    pose = dynamics.pose(q, frame)
    return np.asarray(pose[:3, :3] @ point + pose[:3, 3])


def _point(dynamics: Dynamics, q: Array, frame: str, place: Array) -> Array:
    """Jacobian of what is at a place and belongs to a frame, shape (3, n)."""
    if frame == "world":
        return np.zeros((3, len(q)))
    jacobian, arm = dynamics.jacobian(q, frame), place - dynamics.pose(q, frame)[:3, 3]
    return np.asarray(jacobian[:3] - np.cross(np.eye(3), arm) @ jacobian[3:])


def _apart(dynamics: Dynamics, q: Array, contact: dict[str, Any]) -> Array:
    """How a contact's point moves relative to its plane: along the normal, then tangentially."""
    plane, frame = contact["plane"], contact["frame"]
    place = _place(dynamics, q, frame, contact["point"])
    jacobian = _point(dynamics, q, frame, place)
    jacobian = jacobian - _point(dynamics, q, plane.get("frame", "world"), place)
    normal = np.array(plane.get("normal", (0.0, 0.0, 1.0)))
    side = np.cross(normal, (0.0, 1.0, 0.0))
    return np.array([normal, side, np.cross(normal, side)]) @ jacobian


def _moving(rows: Array) -> Array:
    return rows[abs(rows).max(axis=1) > NOTHING]


def _measured(of: Set, family: str, seed: int, at: float, sim: Simulator) -> Held:
    def moved(factor: float) -> Array:
        sim.reset()
        return np.asarray(sim.step(of.base + factor * of.along).v)

    q = np.array(sim.reset().q)
    try:
        error = _bisected(lambda factor: bool(moved(factor).any()), at)
        M = sim.dynamics.mass_matrix(q)
        off = max(lacking(of, f * at, M, moved(f * at) / TICK) for f in BEYOND)
    except SimulationDiverged:
        error = off = float("inf")
    alone = None if of.cones else _of_dynamics(of, at, sim.dynamics, q)
    return Held(family, seed, at, error, alone, off)


def _of_dynamics(of: Set, at: float, dynamics: Dynamics, q: Array) -> float:
    def moves(factor: float) -> bool:
        tau = of.base + factor * of.along
        forward = dynamics.constrained_forward(q, np.zeros_like(q), tau)[0]
        return bool(abs(forward).max() > ROUNDING)

    try:
        return _bisected(moves, at)
    except InvalidInput:
        return float("inf")


def _bisected(moves: Callable[[float], bool], at: float) -> float:
    """Relative error of the factor from which on a set moves, by bisection."""
    low, high = 0.0, 2.0 * at
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if moves(middle) else (middle, high)
    return abs(high - at) / at


def summary(sets: Sequence[Held]) -> str:
    """The sets by family, and those that are wrong, as Markdown."""
    rows = []
    for family in sorted({one.family for one in sets}):
        own = [one for one in sets if one.family == family]
        alone = max((one.of_dynamics for one in own if one.of_dynamics is not None), default=None)
        rows.append([family, len(own), number(max(one.error for one in own), 1),
                     number(alone, 1), sum(not one.good for one in own)])  # fmt: skip
    head = ("family", "sets", "largest error", "of Dynamics", f"beyond {WITHIN:.0e}")
    wrong = [f"- {one}" for one in sets if not one.good]
    return "\n".join([table(head, rows), *([""] * bool(wrong)), *wrong])
