# SPDX-License-Identifier: Apache-2.0
"""Random kinematic trees, drawn to be unpleasant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOST_JOINTS = 30
MASS = (1e-3, 1e3)  # [kg]
LENGTH = (1e-3, 10.0)  # [m]
SPEED = (1e-2, 1e2)  # [rad/s] or [m/s]
PUSH = (1e-2, 1e2)  # torque as a multiple of what holds the arm up
THIN = 1e-8  # a needle's inertia about its own axis, as a part of the other two
Vector = np.ndarray


@dataclass(frozen=True)
class Tree:
    """A random tree and a random state of it.

    Attributes:
        seed: it was drawn from.
        urdf: its description.
        q: positions [rad] or [m], shape (n,).
        v: velocities [rad/s] or [m/s], shape (n,).
        push: torque as a multiple of the gravity torque.
        traits: what is unpleasant about it, for the table.
    """

    seed: int
    urdf: str
    q: Vector
    v: Vector
    push: float
    traits: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.q)


def draw(seed: int, most_joints: int = MOST_JOINTS) -> Tree:
    """Draw a tree.

    Args:
        seed: the same seed gives the same tree.
        most_joints: it has between one and so many joints.
    """
    rng = np.random.default_rng(seed)
    n = round(_spread(rng, (1, most_joints), 1)[0])
    chain_like = rng.uniform()
    needle = rng.uniform() < 0.3
    wide = rng.uniform() < 0.5
    masses = _spread(rng, MASS, n) if wide else rng.uniform(0.5, 5.0, n)
    lengths = _spread(rng, LENGTH, n) if rng.uniform() < 0.5 else rng.uniform(0.1, 0.5, n)
    parts = ['<?xml version="1.0"?>', f'<robot name="tree{seed}">', '<link name="link0"/>']
    for i in range(n):
        parent = i if rng.uniform() < chain_like else int(rng.integers(0, i + 1))
        shift = lengths[parent - 1] if parent else 0.0
        parts += [
            _link(rng, i + 1, masses[i], lengths[i], needle),
            _joint(rng, i + 1, parent, shift),
        ]
    speed, push = _spread(rng, SPEED, 1)[0], _spread(rng, PUSH, 1)[0]
    q = rng.uniform(-np.pi, np.pi, n)
    v = rng.uniform(-1, 1, n) * speed
    return Tree(seed, "\n".join([*parts, "</robot>"]), q, v, push,
                _traits(n, masses, lengths, needle, speed, push))  # fmt: skip


def _traits(
    n: int, masses: Vector, lengths: Vector, needle: bool, speed: float, push: float
) -> tuple[str, ...]:
    named = {
        f"{n} joints": True,
        f"mass ratio {masses.max() / masses.min():.0e}": masses.max() > 1e3 * masses.min(),
        f"length ratio {lengths.max() / lengths.min():.0e}": lengths.max() > 1e2 * lengths.min(),
        "needles": needle,
        f"speed {speed:.0f}": speed > 10,
        f"torque {push:.0f} times gravity": push > 10,
    }
    return tuple(name for name, there in named.items() if there)


def _spread(rng: np.random.Generator, between: tuple[float, float], count: int) -> Vector:
    low, high = np.log(between)
    return np.exp(rng.uniform(low, high, count))


def _link(rng: np.random.Generator, i: int, mass: float, length: float, needle: bool) -> str:
    thick = THIN if needle else rng.uniform(0.05, 1.0)
    across = mass * length**2 / 12
    along = across * thick
    return (
        f'<link name="link{i}"><inertial><origin xyz="{float(length / 2)!r} 0 0"/>'
        f'<mass value="{float(mass)!r}"/>'
        f'<inertia ixx="{float(along)!r}" iyy="{float(across)!r}" izz="{float(across)!r}" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(rng: np.random.Generator, i: int, parent: int, shift: float) -> str:
    kind = "prismatic" if rng.uniform() < 0.15 else "continuous"
    axis = rng.normal(size=3) if rng.uniform() < 0.3 else np.eye(3)[rng.integers(1, 3)]
    turn = rng.integers(-1, 3, 3) * np.pi / 2 if rng.uniform() < 0.7 else rng.uniform(-3, 3, 3)
    limit = '<limit lower="-1e9" upper="1e9" effort="1e12" velocity="1e9"/>'
    return (
        f'<joint name="joint{i}" type="{kind}"><parent link="link{parent}"/>'
        f'<child link="link{i}"/><origin xyz="{float(shift)!r} 0 0" rpy="{_triple(turn)}"/>'
        f'<axis xyz="{_triple(axis / np.linalg.norm(axis))}"/>'
        f"{limit if kind == 'prismatic' else ''}</joint>"
    )


def _triple(values: Vector) -> str:
    return " ".join(repr(float(x)) for x in values)
