# SPDX-License-Identifier: Apache-2.0
"""Random robots: trees of skewed joints with full inertia tensors, written as URDF."""

from collections.abc import Iterable, Sequence

import numpy as np

KINDS = ("revolute", "continuous", "prismatic", "fixed")


def random_tree(rng: np.random.Generator, joints: int) -> str:
    """Write a random tree that a machinist could build."""
    parts = _beginning()
    for i in range(1, joints + 1):
        parent = int(rng.integers(max(0, i - 3), i))
        kind = rng.choice(KINDS, p=(0.5, 0.2, 0.18, 0.12)) if i > 1 else "revolute"
        parts += [_link(rng, i), _joint(rng, i, parent, str(kind))]
    return "\n".join([*parts, "</robot>"])


def tree(rng: np.random.Generator, parents: Iterable[int], kinds: Sequence[str]) -> str:
    """Write a tree of given shape: URDF text with the names of ``random_tree``."""
    parts = _beginning()
    for i, (parent, kind) in enumerate(zip(parents, kinds, strict=True), 1):
        parts += [_link(rng, i), _joint(rng, i, parent, kind)]
    return "\n".join([*parts, "</robot>"])


def _beginning() -> list[str]:
    return ['<robot name="random_tree">', '<link name="link0"/>']


def _link(rng: np.random.Generator, i: int) -> str:
    """A body made of six point masses and a small ball, so that its tensor is always possible."""
    points = rng.uniform(-0.15, 0.15, (6, 3))
    masses = rng.uniform(0.05, 0.6, 6)
    mass, com = masses.sum(), masses @ points / masses.sum()
    arms = points - com
    tensor = np.einsum("k,kij->ij", masses, [(a @ a) * np.eye(3) - np.outer(a, a) for a in arms])
    tensor += 1e-3 * np.eye(3)
    names = ("xx", "xy", "xz", "yy", "yz", "zz")
    moments = " ".join(
        f'i{n}="{float(tensor[np.triu_indices(3)][k])!r}"' for k, n in enumerate(names)
    )
    return (
        f'<link name="link{i}"><inertial><origin xyz="{_triple(com)}" rpy="0 0 0"/>'
        f'<mass value="{float(mass)!r}"/><inertia {moments}/></inertial></link>'
    )


def _joint(rng: np.random.Generator, i: int, parent: int, kind: str) -> str:
    limit = '<limit lower="-3" upper="3" effort="500" velocity="20"/>'
    xyz, rpy, axis = rng.uniform(-0.4, 0.4, 3), rng.uniform(-3, 3, 3), rng.normal(size=3)
    return (
        f'<joint name="joint{i}" type="{kind}">'
        f'<parent link="link{parent}"/><child link="link{i}"/>'
        f'<origin xyz="{_triple(xyz)}" rpy="{_triple(rpy)}"/><axis xyz="{_triple(axis)}"/>'
        f"{limit if kind in ('revolute', 'prismatic') else ''}</joint>"
    )


def _triple(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
