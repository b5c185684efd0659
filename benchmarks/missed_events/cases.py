# SPDX-License-Identifier: Apache-2.0
"""Random scenes in which much happens between the ends of a tick.

One to three joints with stops (rigid, elastic, soft), dry friction, flexible drives with backlash,
current limits, cords and contact with the ground; stiffness over six decades, ticks of 0.1 to 50
ms, every method, with and without error control.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

FIXED = ("euler", "semi_implicit_euler", "midpoint", "heun", "rk4", "dopri5", "dop853", "implicit")
CONTROLLED = ("dopri5", "dop853", "implicit")
TICKS = 20  # of a run: an error grows from event to event


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes:
        scene: the scene.
        method: name of the method; None for the default.
        dt: length of a tick [s].
        tolerance: of error control; None without it or for the default.
        q: start, shape (n,).
        v: speed at the start, shape (n,).
        command: for each tick, shape (ticks, n).
        label: the features, in words.
    """

    scene: dict[str, Any]
    method: str | None
    dt: float
    tolerance: float | None
    q: np.ndarray
    v: np.ndarray
    command: np.ndarray
    label: str


def draw(seed: int) -> Case:
    """A random case."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    masses = _log(rng, 0.1, 10.0, n)
    turning = rng.random(n) < 0.5
    scene: dict[str, Any] = {"robot": {"urdf": _urdf(masses, turning)}, "gravity": [0, 0, -9.81]}
    labels: list[str] = []
    joints = {f"j{i}": _joint(rng, masses[i:].sum(), labels) for i in range(n)}
    scene["joints"] = {name: entry for name, entry in joints.items() if entry}
    if rng.random() < 0.25:
        scene["springs"] = [_cord(rng, n, labels)]
    if rng.random() < 0.3:
        scene["constraints"] = [_contact(rng, n, labels)]
    dt = float(_log(rng, 1e-4, 5e-2))
    method, tolerance = _way(rng)
    size = _log(rng, 0.3, 30.0, n)
    command = size * rng.uniform(-1, 1, (TICKS, n))
    q = rng.uniform(-0.2, 0.2, n)
    speed = rng.uniform(-2, 2, n) * (rng.random(n) < 0.7)
    return Case(scene, method, dt, tolerance, q, speed, command, ", ".join(sorted(set(labels))))


def _way(rng: np.random.Generator) -> tuple[str | None, float | None]:
    kind = rng.random()
    if kind < 0.3:
        return None, None
    if kind < 0.65:
        return str(rng.choice(FIXED)), None
    return str(rng.choice(CONTROLLED)), float(_log(rng, 1e-10, 1e-5))


def _joint(rng: np.random.Generator, mass: float, labels: list[str]) -> dict[str, Any]:
    entry: dict[str, Any] = {}
    if rng.random() < 0.6:
        sliding = float(_log(rng, 0.05, 5.0))
        entry["friction"] = {"coulomb": sliding}
        if rng.random() < 0.4:
            entry["friction"] |= {"static": 1.5 * sliding, "stribeck_velocity": 0.05}
        labels.append("dry friction")
    if rng.random() < 0.6:
        entry["limits"] = {"lower": -0.25, "upper": 0.25, "stop": _stop(rng, mass, labels)}
    if rng.random() < 0.4:
        entry |= _drive(rng, mass, labels)
    if rng.random() < 0.2:
        entry["spring"] = {"stiffness": float(_log(rng, 1.0, 1e4)) * mass}
        labels.append("spring")
    return entry


def _stop(rng: np.random.Generator, mass: float, labels: list[str]) -> dict[str, float]:
    if rng.random() < 0.4:
        labels.append("rigid stop")
        return {"restitution": float(rng.choice([0.0, 0.5, 1.0]))}
    stiffness = float(_log(rng, 1e2, 1e8)) * mass
    labels.append("compliant stop")
    return {
        "stiffness": stiffness,
        "damping": float(rng.choice([0, 0.1])) * np.sqrt(stiffness * mass),
    }


def _drive(rng: np.random.Generator, mass: float, labels: list[str]) -> dict[str, Any]:
    actuator: dict[str, Any] = {"rotor_inertia": float(_log(rng, 0.05, 1.0)) * mass}
    if rng.random() < 0.4:
        labels.append("current limit")
        return {
            "actuator": actuator
            | {
                "command": "voltage", "resistance": 1.0, "torque_constant": 0.5,
                "inductance": float(_log(rng, 1e-4, 1e-1)), "current_limit": 3.0,
            }
        }  # fmt: skip
    transmission = {"stiffness": float(_log(rng, 1e2, 1e7)) * mass}
    transmission["damping"] = float(rng.choice([0, 0.05])) * np.sqrt(
        transmission["stiffness"] * mass
    )
    labels.append("flexible drive")
    if rng.random() < 0.3:
        transmission["backlash"] = 0.01
        labels.append("backlash")
    return {"actuator": actuator, "transmission": transmission}


def _cord(rng: np.random.Generator, n: int, labels: list[str]) -> dict[str, Any]:
    labels.append("cord")
    return {
        "name": "cord", "frames": [f"l{n}", "world"], "points": [[0, 0, 0], [0, 0, 1.0]],
        "stiffness": float(_log(rng, 1e2, 1e6)), "rest_length": float(rng.uniform(0.8, 1.4)),
        "tension_only": True,
    }  # fmt: skip


def _contact(rng: np.random.Generator, n: int, labels: list[str]) -> dict[str, Any]:
    labels.append("contact")
    return {
        "type": "contact", "frame": f"l{n}", "plane": {"point": [0, 0, -0.4]},
        "friction": float(rng.choice([0.0, 0.3])), "restitution": float(rng.choice([0.0, 0.5])),
    }  # fmt: skip


def _urdf(masses: np.ndarray, turning: np.ndarray) -> str:
    parts = ['<robot name="chain"><link name="l0"/>']
    for i, mass in enumerate(masses):
        kind, axis = (
            ("continuous", "0 1 0") if turning[i] else ("prismatic", ("1 0 0", "0 0 1")[i % 2])
        )
        limit = "" if turning[i] else '<limit lower="-9" upper="9" effort="1e9" velocity="1e9"/>'
        parts.append(
            f'<link name="l{i + 1}"><inertial><origin xyz="0.2 0 0"/><mass value="{mass!r}"/>'
            f'<inertia ixx="{0.05 * mass!r}" ixy="0" ixz="0" iyy="{0.05 * mass!r}" iyz="0" '
            f'izz="{0.05 * mass!r}"/></inertial></link>'
            f'<joint name="j{i}" type="{kind}"><origin xyz="0.3 0 0"/><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/><axis xyz="{axis}"/>{limit}</joint>'
        )
    return "".join([*parts, "</robot>"]).replace("np.float64(", "").replace(")", "")


def _log(rng: np.random.Generator, low: float, high: float, size: int | None = None) -> Any:
    return np.exp(rng.uniform(np.log(low), np.log(high), size))
