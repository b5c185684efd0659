# SPDX-License-Identifier: Apache-2.0
"""Motions that are known: the ones that the tests in test/reference hold the simulator against."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "test/reference"
SCENES = ROOT / "src/arm_sim/arm_sim/scenes"
STEPS = (0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)  # [s]
FEW_STEPS = STEPS[:7]  # [s]
TICKS = (1e-3, 0.5)  # [s]; within the long one error control has all the say
Vector = np.ndarray


@dataclass(frozen=True)
class Problem:
    """A motion whose course is known."""

    name: str  # as shown in tables
    scene: Path  # scene file
    expected: dict[float, Vector]  # what ``observe`` should give, by time [s]
    # From joint positions to what the reference states, [rad] or [m]
    observe: Callable[[Vector], Vector]
    gate: float  # largest error that the tests allow ``gated`` at 1 ms
    # Positions and velocities; None for the scene's own
    start: tuple[list[float], list[float]] | None = None
    gated: str = "rk4"  # method that the gate speaks of
    steps: tuple[float, ...] = STEPS  # fixed steps to try [s]
    ticks: tuple[float, ...] = TICKS  # ticks for error control [s]

    @property
    def duration(self) -> float:
        """Last time that is compared [s]."""
        return max(self.expected)


def all_problems(trajectory: float) -> list[Problem]:
    """Every problem; ``trajectory`` is the tests' gate for RK4 at 1 ms."""
    return [
        *_pendulums(trajectory),
        *_double_pendulums(trajectory),
        _spherical_pendulum(trajectory),
        _free_top(trajectory),
        *_four_bars(trajectory),
        _panda(),
        _stiff_elbow(trajectory),
        _wheel(trajectory),
    ]


def reference(name: str) -> dict[str, Any]:
    """The content of one of the tests' files of known values."""
    content: dict[str, Any] = json.loads((REFERENCE / f"{name}.json").read_text())
    return content


def numbers(texts: list[str]) -> Vector:
    """Digits as doubles."""
    return np.array([float(text) for text in texts])


def _pendulums(gate: float) -> list[Problem]:
    places, scene = reference("pendulum")["position"], SCENES / "pendulum.yaml"
    short, long = (
        Problem(name, scene, {float(t): numbers(places[t]) for t in times}, _below, gate)
        for name, times in (("pendulum", "1 2 5 10".split()), ("long pendulum", ("100", "2000")))
    )
    return [short, replace(long, steps=FEW_STEPS, ticks=TICKS[1:])]


def _below(q: Vector) -> Vector:
    return np.array([np.sin(q[0]), -np.cos(q[0])])


def _double_pendulums(gate: float) -> list[Problem]:
    data, scene = reference("double_pendulum"), SCENES / "double_pendulum.yaml"

    def problem(name: str, case: str, first: float, second: float) -> Problem:
        expected = {float(t): _elbow(numbers(x)) for t, x in data[case].items()}
        start = [first, second - first], [0.0, 0.0]
        return Problem(name, scene, expected, np.copy, gate, start)

    return [
        problem("double pendulum", "pi6_pi4", np.pi / 6, np.pi / 4),
        problem("double pendulum, wild", "pi2_pi2", np.pi / 2, np.pi / 2),
    ]


def _elbow(state: Vector) -> Vector:
    """Absolute angles to joint angles."""
    return np.array([state[0], state[1] - state[0]])


def _spherical_pendulum(gate: float) -> Problem:
    places = reference("spherical_pendulum")["position"]

    def place(q: Vector) -> Vector:
        (sa, sb), (ca, cb) = np.sin(q), np.cos(q)
        return np.array([-sb, sa * cb, -ca * cb])

    expected, start = {float(t): numbers(x) for t, x in places.items()}, [0.0, -np.pi / 3]
    scene, rates = REFERENCE / "spherical_pendulum.urdf", [2.0 / 0.5, 0.0]
    return Problem("spherical pendulum", scene, expected, place, gate, (start, rates))


def _free_top(gate: float) -> Problem:
    data = reference("free_top")
    R = numbers(data["attitude"]["0"]).reshape(3, 3)
    q = [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])]
    rings = ring_rates(np.array(q))
    v = np.linalg.solve(rings, numbers(data["rates"]["0"]))
    expected = {float(t): numbers(x) for t, x in data["attitude"].items() if t != "0"}
    start = [float(x) for x in q], v.tolist()
    return Problem("free top", REFERENCE / "free_top.urdf", expected, _attitude, gate, start)


def _attitude(q: Vector) -> Vector:
    """Rx(a) Ry(b) Rz(c), row by row."""
    (ca, cb, cc), (sa, sb, sc) = np.cos(q), np.sin(q)
    return np.array([
        cb * cc, -cb * sc, sb,
        ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb,
        sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb,
    ])  # fmt: skip


def ring_rates(q: Vector) -> Vector:
    """Body rates from ring rates."""
    _, b, c = q
    outer = [np.cos(b) * np.cos(c), -np.cos(b) * np.sin(c), np.sin(b)]
    return np.column_stack([outer, [np.sin(c), np.cos(c), 0.0], [0.0, 0.0, 1.0]])


def _four_bars(gate: float) -> list[Problem]:
    data, problems = reference("four_bar"), []
    for N, name in (("1", "four-bar"), ("2", "two four-bars")):
        expected = {float(t): numbers(x[:1]) for t, x in data[N].items()}
        problems.append(Problem(name, REFERENCE / f"four_bar_{N}.yaml", expected, np.copy, gate))
    return problems


def _panda() -> Problem:
    motion = reference("panda")["motion"]
    scene = ROOT / "test/models/panda_free.yaml"
    expected = {float(t): numbers(motion[t]["q"]) for t in ("0.5", "1")}
    return Problem("Panda", scene, expected, np.copy, 5e-6)


def _stiff_elbow(gate: float) -> Problem:
    motion = reference("stiff_elbow")["motion"]
    expected = {float(t): _elbow(numbers(x)) for t, x in motion.items()}
    scene = REFERENCE / "stiff_elbow.yaml"
    return Problem("stiff elbow", scene, expected, np.copy, gate, gated="implicit")


def _wheel(gate: float) -> Problem:
    angle = numbers([reference("coulomb")["coast_down"]["angle"]])
    steps = tuple(step for step in STEPS if step >= 1e-3)
    scene = REFERENCE / "wheel.yaml"
    return Problem("dry wheel", scene, {1.0: angle}, np.copy, gate, steps=steps)
