# SPDX-License-Identifier: Apache-2.0
"""Random arms, drawn to be unpleasant; the same seed gives the same arm."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from arm_dynamics import Dynamics

MOST_JOINTS = 30
MASSES = (1e-3, 1e3)  # [kg]
LENGTHS = (1e-3, 10.0)  # [m]
SLOW, FAST = (1e-2, 1.0), (1.0, 100.0)  # [rad/s]; sliding joints a tenth of it in [m/s]
PUSH = (1.0, 1e5)  # [rad/s²] that the torque demands at first
ABSURD = (1e12, 1e30)  # [rad/s²]; few joints, since error control takes long to give up
NEEDLE = 1e-4  # thickness of a needle as a part of its length
CALM = (0.1, 1.0)  # [rad/s²]
RATE = (0.1, 1e4)  # [1/s] at which viscous friction takes a joint's speed
FEW = 3
Vector = np.ndarray


@dataclass(frozen=True)
class Arm:
    """An arm, where it starts, and the torque that is held.

    Attributes:
        seed: it was drawn from.
        scene: for ``load_scene``.
        q: positions at the start [rad] or [m], shape (n,).
        v: velocities [rad/s] or [m/s], shape (n,).
        tau: torque [N m] or [N], shape (n,).
        rate: fastest rate of its viscous friction [1/s], 0 without.
        traits: what is unpleasant about it.
    """

    seed: int
    scene: dict[str, Any] = field(repr=False)
    q: Vector
    v: Vector
    tau: Vector
    rate: float
    traits: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.q)

    @property
    def dry(self) -> bool:
        """Whether a joint can stick."""
        return "dry friction" in self.traits


def draw(seed: int, most_joints: int = MOST_JOINTS) -> Arm:
    """Draw an arm.

    Args:
        seed: any number that is not negative.
        most_joints: it has between one and so many, few more often than many.

    Raises:
        ArmError: If the arm is refused.
    """
    rng = np.random.default_rng(seed)
    n = int((most_joints + 1) ** rng.uniform() ** 0.7)
    hard = {name: rng.uniform() < chance for name, chance in HARDSHIPS.items()}
    n = min(n, FEW) if hard["absurd torque"] else n
    kinds = rng.choice(("revolute", "continuous", "prismatic"), n, p=(0.45, 0.35, 0.2))
    scene = {"robot": {"urdf": _urdf(rng, kinds, hard)}}
    if hard["weightless"]:
        scene["gravity"] = [0.0, 0.0, 0.0]
    q = rng.uniform(-np.pi, np.pi, n) * np.where(kinds == "prismatic", 0.1, 1.0)
    speed = _between(rng, FAST if hard["fast"] else SLOW)
    v = rng.uniform(-1, 1, n) * np.where(kinds == "prismatic", 0.1, 1.0) * speed
    bare = Dynamics(scene)
    friction = str(rng.choice(("no friction", "viscous friction", "dry friction"), p=FRICTIONS))
    push = ABSURD if hard["absurd torque"] else PUSH if hard["extreme torque"] else CALM
    tau = bare.inverse(q, v, rng.uniform(-1, 1, n) * _between(rng, push))
    rates = np.zeros(n)
    if friction != "no friction":
        scene["joints"], rates = _friction(rng, bare, q, tau, friction == "dry friction")
    traits = (f"{n} joints", *(name for name, there in hard.items() if there), friction)
    return Arm(seed, scene, q, v, tau, float(rates.max()), traits)


HARDSHIPS = {
    "uneven masses": 0.35, "uneven lengths": 0.35, "needles": 0.35, "fast": 0.4,
    "extreme torque": 0.25, "absurd torque": 0.05, "weightless": 0.2,
}  # fmt: skip
FRICTIONS = (0.5, 0.3, 0.2)


def _between(rng: np.random.Generator, ends: tuple[float, float]) -> float:
    low, high = np.log(ends)
    return float(np.exp(rng.uniform(low, high)))


def _spread(rng: np.random.Generator, ends: tuple[float, float], n: int) -> Vector:
    """Sizes from a third of a range to all of it: at random, growing or shrinking to the tips."""
    least, most = np.log(ends)
    span = (most - least) * rng.uniform(1 / 3, 1)
    low = rng.uniform(least, most - span)
    sizes = np.exp(low + span * rng.permutation(np.linspace(0.0, 1.0, n)))
    order = rng.integers(3)
    return sizes if order == 0 else np.sort(sizes)[:: -1 if order == 1 else 1]


def _urdf(rng: np.random.Generator, kinds: Vector, hard: dict[str, bool]) -> str:
    n = len(kinds)
    masses = _spread(rng, MASSES if hard["uneven masses"] else (0.5, 5.0), n)
    lengths = _spread(rng, LENGTHS if hard["uneven lengths"] else (0.1, 0.5), n)
    skew, branching = rng.uniform() < 0.5, float(rng.choice((0.0, 0.2, 0.6)))
    parts = ['<?xml version="1.0"?>', '<robot name="arm">', '<link name="link0"/>']
    for i, kind in enumerate(kinds):
        parent = int(rng.integers(0, i + 1)) if rng.uniform() < branching else i
        shift = lengths[parent - 1] if parent else 0.0
        thin = NEEDLE if hard["needles"] else float(rng.uniform(0.1, 0.6))
        parts += [
            _link(i + 1, masses[i], lengths[i], thin),
            _joint(rng, i + 1, parent, str(kind), shift, skew),
        ]
    return "\n".join([*parts, "</robot>"])


def _link(i: int, mass: float, length: float, thin: float) -> str:
    """A rod along x from its joint on; inertia of an ellipsoid with axes 1, thin, thin/2."""
    a, b, c = (length / 2 * part for part in (1.0, thin, thin / 2))
    ixx, iyy, izz = (float(mass / 5 * s) for s in (b * b + c * c, a * a + c * c, a * a + b * b))
    return (
        f'<link name="link{i}"><inertial><origin xyz="{float(length / 2)!r} 0 0"/>'
        f'<mass value="{float(mass)!r}"/><inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(
    rng: np.random.Generator, i: int, parent: int, kind: str, shift: float, skew: bool
) -> str:
    """At the end of the parent's rod; one in eight turns or slides along its own rod."""
    axis, turn = _skew(rng) if skew else _square(rng)
    limit = (
        "" if kind == "continuous" else '<limit lower="-1e9" upper="1e9" effort="0" velocity="0"/>'
    )
    return (
        f'<joint name="joint{i}" type="{kind}"><parent link="link{parent}"/>'
        f'<child link="link{i}"/><origin xyz="{float(shift)!r} 0 0" rpy="{_triple(turn)}"/>'
        f'<axis xyz="{_triple(axis)}"/>{limit}</joint>'
    )


def _skew(rng: np.random.Generator) -> tuple[Vector, Vector]:
    axis = np.eye(3)[0] if rng.uniform() < 0.125 else rng.normal(size=3)
    return axis / np.linalg.norm(axis), rng.uniform(-np.pi, np.pi, 3)


def _square(rng: np.random.Generator) -> tuple[Vector, Vector]:
    axis = np.eye(3)[rng.choice(3, p=(0.125, 0.4375, 0.4375))]
    return axis, rng.integers(-1, 3, 3) * np.pi / 2


def _friction(
    rng: np.random.Generator, bare: Dynamics, q: Vector, tau: Vector, dry: bool
) -> tuple[dict[str, Any], Vector]:
    """Viscous coefficients by the rate at which they stop a joint, dry levels by the torque.

    A unit torque on joint i gives it the acceleration (M⁻¹)ᵢᵢ, so c = rate / (M⁻¹)ᵢᵢ.
    """
    n, still = len(q), np.zeros(len(q))
    ease = [
        bare.forward(q, still, unit)[i] - bare.forward(q, still, still)[i]
        for i, unit in enumerate(np.eye(n))
    ]
    rates = np.exp(rng.uniform(*np.log(RATE))) * rng.uniform(0, 1, n) * (not dry)
    levels = abs(tau) * 10 ** rng.uniform(-2, 0.5, n) * dry
    joints = {}
    for i, name in enumerate(bare.joint_names):
        own = {"viscous": float(rates[i] / ease[i]), "coulomb": float(levels[i])}
        if dry and rng.uniform() < 0.5:
            own |= {"static": float(1.5 * levels[i]), "stribeck_velocity": 0.05}
        joints[name] = {"friction": own}
    return joints, rates


def _triple(values: Vector) -> str:
    return " ".join(repr(float(x)) for x in values)
