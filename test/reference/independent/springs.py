# SPDX-License-Identifier: Apache-2.0
"""Springs with dampers: at a joint, and between two points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .description import only
from .flow import Flow
from .tree import Point, Tree

Array = np.ndarray


class JointSpring:
    """τ = -k (q - rest) - d v."""

    size = 0

    def __init__(self, joint: int, said: Mapping[str, Any]) -> None:
        only(said, "spring", "stiffness", "rest", "damping")
        self.joint, self.k = joint, said["stiffness"]
        self.rest, self.d = said.get("rest", 0.0), said.get("damping", 0.0)

    def initial(self, q: float, v: float) -> tuple[float, ...]:
        return ()

    def kinks(self, q: float, v: float, z: Array) -> tuple[float, ...]:
        return ()

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        bent = q - self.rest
        return Flow(-self.k * bent - self.d * v, (), 0.5 * self.k * bent**2, lost=self.d * v**2)


class PointSpring:
    """Pulls two points together with k (l - rest) + d l'; ask after ``Tree.move``."""

    def __init__(self, tree: Tree, said: Mapping[str, Any]) -> None:
        only(said, "springs", "name", "frames", "points", "stiffness", "rest_length", "damping")
        pairs = zip(said["frames"], said.get("points", [(0, 0, 0)] * 2), strict=True)
        self._ends = [Point(tree, *pair) for pair in pairs]
        self.k, self.rest = said["stiffness"], said.get("rest_length", 0.0)
        self.d = said.get("damping", 0.0)

    def act(self, v: Array) -> tuple[Array, float, float]:
        """Torques [N m], energy [J] and heat [W]."""
        first, second = self._ends
        apart = first.place() - second.place()
        length = float(np.linalg.norm(apart))
        row = apart / length @ (first.jacobian() - second.jacobian())
        rate, longer = float(row @ v), length - self.rest
        pull = self.k * longer + self.d * rate
        return -pull * row, 0.5 * self.k * longer**2, self.d * rate**2
