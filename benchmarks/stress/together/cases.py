# SPDX-License-Identifier: Apache-2.0
"""Random sets of features with random starts and commands; the same seed gives the same case."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, load_scene
from benchmarks.stress.verdict import Setting

TEST = str(Path(__file__).parents[3] / "test")
sys.path[:0] = [] if TEST in sys.path else [TEST]

from models import features  # noqa: E402  the features are the tests' own

FAMILIAR = (
    "viscous", "coulomb", "armature", "spring", "current", "end stop", "bilateral", "contact",
    "ball", "mimic", "payload", "point spring",
)  # fmt: skip
"""Features that MuJoCo has words for; Coulomb friction without a static level."""
TOUCHING = ("end stop", "contact", *features.TOUCHING)
EVERYTHING = (*features.ALL, *features.TOUCHING)
FEWEST, MOST = 2, 8
TICKS = (0.25e-3, 4e-3)  # [s]
HORIZON = 0.5  # [s]
TRIES = 40  # starts that are offered, since a loop may not close or a tip be inside a plane
LIMITS = {"planar": (80.0, 40.0, 20.0), "panda": (87.0,) * 4 + (12.0,) * 3}  # [N m]
PUSH = (0.02, 0.3)  # of a joint's limit
CHIRP = (0.5, 50.0)  # [Hz]
SETTINGS = (
    (0.45, "rk4", None), (0.13, "dopri5", 1e-6), (0.12, "dopri5", 1e-9), (0.13, "dop853", 1e-6),
    (0.12, "dop853", 1e-9), (0.05, "euler", None),
)  # fmt: skip
EXTREMES = {"friction x10": 0.12, "stiffness x100": 0.12, "restitution 1": 0.12, "mass x10": 0.12}
Vector = np.ndarray


@dataclass(frozen=True)
class Drive:
    """A start and a command.

    Attributes:
        kind: of command.
        q: positions at the start in [rad], the first that the scene allows, shape (TRIES, n).
        v: velocities in [rad/s], likewise.
        command: torque, current or voltage of each joint in each tick, shape (ticks, n).
    """

    kind: str
    q: Vector
    v: Vector
    command: Vector


@dataclass(frozen=True)
class Case:
    """A scene, a way to integrate it, and several runs.

    Attributes:
        seed: it was drawn from.
        arm: ``planar`` or ``panda``.
        features: of the scene.
        extremes: what is extreme about it.
        scene: for ``load_scene``.
        setting: how it is integrated.
        drives: the runs.
    """

    seed: int
    arm: str
    features: tuple[str, ...]
    extremes: tuple[str, ...]
    scene: dict[str, Any] = field(repr=False)
    setting: Setting
    drives: tuple[Drive, ...] = field(repr=False)

    @property
    def familiar(self) -> bool:
        """Whether MuJoCo has words for all of it."""
        return {*self.features} <= {*FAMILIAR} and not any(
            "static" in joint.get("friction", {}) for joint in self.scene["joints"].values()
        )

    @property
    def touches(self) -> bool:
        """Whether there are impacts and contacts in it, of which MuJoCo has another model."""
        return bool({*self.features} & {*TOUCHING})

    @property
    def label(self) -> str:
        """Arm, features and what is extreme, in words."""
        extremes = f" ({', '.join(self.extremes)})" if self.extremes else ""
        return f"{self.arm}: {', '.join(self.features)}{extremes}"


def draw(seed: int, runs: int) -> Case:
    """Draw a case.

    Args:
        seed: any number that is not negative.
        runs: starts and commands of it.
    """
    rng = np.random.default_rng([seed, 1])
    arm = "planar" if rng.uniform() < 0.6 else "panda"
    familiar = rng.uniform() < 0.4
    among = FAMILIAR if familiar else EVERYTHING
    picked = {*rng.choice(among, rng.integers(FEWEST, MOST + 1), replace=False)}
    chosen = tuple(name for name in EVERYTHING if name in picked)
    scene = features.scene(arm, chosen)
    if "coulomb" in chosen and (familiar or rng.uniform() < 0.5):
        _without_static(scene["joints"])
    extremes = tuple(name for name, chance in EXTREMES.items() if rng.uniform() < chance)
    _exaggerate(rng, scene, extremes)
    k = rng.choice(len(SETTINGS), p=[chance for chance, *_ in SETTINGS])
    dt = round(float(np.exp(rng.uniform(*np.log(TICKS)))), 6)
    setting = Setting(SETTINGS[k][1], dt, SETTINGS[k][2])
    names = ArmModel(load_scene(scene)).joint_names
    drives = tuple(_drive(rng, arm, scene, names, dt) for _ in range(runs))
    return Case(seed, arm, chosen, extremes, scene, setting, drives)


def _without_static(joints: dict[str, Any]) -> None:
    for joint in joints.values():
        for key in ("static", "stribeck_velocity"):
            joint.get("friction", {}).pop(key, None)


def _exaggerate(
    rng: np.random.Generator, scene: dict[str, Any], extremes: tuple[str, ...]
) -> None:
    if "friction x10" in extremes:
        _scale(scene, {"coulomb", "viscous", "static", "friction"}, 10.0)
    if "stiffness x100" in extremes:
        _scale(scene, {"stiffness", "sigma0"}, 100.0)
    if "restitution 1" in extremes:
        _scale(scene, {"restitution"}, 0.0, 1.0)
    if "mass x10" in extremes:
        scene["robot"]["urdf"] = _heavier(rng, scene["robot"]["urdf"], 10.0)


def _scale(part: Any, keys: set[str], factor: float, offset: float = 0.0) -> None:
    """Scale every number under one of ``keys``, wherever it is."""
    pairs = part.items() if isinstance(part, dict) else enumerate(part)
    for key, value in list(pairs):
        if isinstance(value, dict | list):
            _scale(value, keys, factor, offset)
        elif key in keys:
            part[key] = float(value) * factor + offset


def _heavier(rng: np.random.Generator, urdf: str, factor: float) -> str:
    """The robot with one link of so many times its mass and inertia."""
    root = ElementTree.fromstring(urdf)
    bodies = root.findall("link/inertial")
    body = bodies[rng.integers(len(bodies))]
    for element in (*body.findall("mass"), *body.findall("inertia")):
        for key, value in element.attrib.items():
            element.set(key, repr(float(value) * factor))
    return ElementTree.tostring(root, encoding="unicode")


def _drive(
    rng: np.random.Generator, arm: str, scene: dict[str, Any], names: tuple[str, ...], dt: float
) -> Drive:
    home = np.array([features.START[arm].get(name, 0.0) for name in names])
    spread = np.linspace(0.6, 0.02, TRIES)[:, None]  # nearer to home with each try
    q = home + spread * rng.uniform(-1, 1, (TRIES, len(names)))
    about = features.ARMS[arm]
    if _stopped(scene, arm):
        k, stop = names.index(about["joints"][1]), about["stop"]
        q[:, k] = q[:, k].clip(stop["lower"], stop["upper"])
    v = rng.uniform(-1, 1, len(names)) * rng.choice((0.0, 1.0, 3.0))
    kind = str(rng.choice(("constant", "chirp", "bang-bang")))
    ticks = round(HORIZON / dt)
    hold = np.array([features.TORQUE[arm].get(name, 0.0) for name in names])
    push = np.exp(rng.uniform(*np.log(PUSH))) * np.array(LIMITS[arm])
    torque = hold + push * _shape(rng, kind, np.arange(ticks) * dt, len(names))
    return Drive(kind, q, v, torque * _unit(scene, names))


def _stopped(scene: dict[str, Any], arm: str) -> bool:
    joint = scene["joints"].get(features.ARMS[arm]["joints"][1], {})
    return isinstance(joint.get("limits", {}).get("stop"), dict)


def _shape(rng: np.random.Generator, kind: str, time: Vector, n: int) -> Vector:
    """A signal between -1 and 1 for each joint, shape (ticks, n)."""
    if kind == "constant":
        return np.tile(rng.uniform(-1, 1, n), (len(time), 1))
    if kind == "chirp":
        low, high = np.sort(np.exp(rng.uniform(*np.log(CHIRP), (2, n))), axis=0)
        turns = low * time[:, None] + (high - low) * time[:, None] ** 2 / (2 * HORIZON)
        return np.sin(2 * np.pi * (turns + rng.uniform(0, 1, n)))
    period = np.exp(rng.uniform(*np.log((0.005, 0.2)), n))
    return np.sign(np.sin(np.pi * (time[:, None] / period + rng.uniform(0, 2, n))) + 1e-9)


def _unit(scene: dict[str, Any], names: tuple[str, ...]) -> Vector:
    """What a joint's drive takes for a torque of 1 N m at rest, shape (n,)."""
    current = 1.0 / features.PER_AMPERE
    units = {"current": current, "voltage": current * features.MOTOR["resistance"]}
    drives = [scene["joints"].get(name, {}).get("actuator", {}) for name in names]
    return np.array([units.get(drive.get("command"), 1.0) for drive in drives])
