# SPDX-License-Identifier: Apache-2.0
"""Large robots: an arm of many joints, and two-armed mobile robots with hands."""

import numpy as np

from models.random_tree import tree


def snake(rng: np.random.Generator, joints: int) -> str:
    """URDF text of one arm of revolute joints."""
    return tree(rng, range(joints), ["revolute"] * joints)


def mobile(rng: np.random.Generator, joints: int) -> str:
    """URDF text of a base on two slides and a turn, two arms of 7 joints, and fingers of 4."""
    parents, kinds = [0, 1, 2], ["prismatic", "prismatic", "continuous"]
    hands = [_chain(parents, 3, 7), _chain(parents, 3, 7)]
    while len(parents) < joints:
        _chain(parents, hands[len(parents) // 4 % 2], min(4, joints - len(parents)))
    return tree(rng, parents, kinds + ["revolute"] * (joints - 3))


def _chain(parents: list[int], parent: int, count: int) -> int:
    """Add joints one after another; return the last one's link."""
    for _ in range(count):
        parents.append(parent)
        parent = len(parents)
    return parent
