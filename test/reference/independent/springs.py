# SPDX-License-Identifier: Apache-2.0
"""Springs with dampers: at a joint, beyond a soft stop, and between two points."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .description import only
from .flow import Flow, Law
from .tree import Point, Tree

Array = np.ndarray


class JointSpring(Law):
    """τ = -k (q - rest) - d v."""

    def __init__(self, joint: int, said: Mapping[str, Any]) -> None:
        only(said, "spring", "stiffness", "rest", "damping")
        self.joint, self.k = joint, said["stiffness"]
        self.rest, self.d = said.get("rest", 0.0), said.get("damping", 0.0)

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        bent = q - self.rest
        return Flow(-self.k * bent - self.d * v, (), 0.5 * self.k * bent**2, lost=self.d * v**2)


class SoftStop(Law):
    """Pushes back with k δ + d δ' at a depth δ beyond one end of a range, and never pulls."""

    def __init__(self, joint: int, at: float, way: int, said: Mapping[str, Any]) -> None:
        only(said, "stop", "stiffness", "damping")
        self.joint, self._at, self._way = joint, at, way
        self.k, self.d = said["stiffness"], said.get("damping", 0.0)

    def kinks(self, q: float, v: float, z: Array) -> tuple[float, ...]:
        depth = self._way * (self._at - q)
        return (depth, depth - self.d / self.k * self._way * v) if self.d else (depth,)

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        if signs[0] < 0.0:
            return Flow(0.0)
        depth, deeper = self._way * (self._at - q), -self._way * v
        push = self.k * depth + self.d * deeper if signs[-1] > 0.0 else 0.0
        return Flow(
            self._way * push, (), 0.5 * self.k * depth**2, lost=(push - self.k * depth) * deeper
        )


def soft_stops(joint: int, limits: Mapping[str, Any]) -> list[SoftStop]:
    """The ends of a joint's range, if they are soft."""
    said = limits.get("stop", True)
    if not isinstance(said, Mapping) or "stiffness" not in said:
        return []
    ends = [("lower", 1), ("upper", -1)]
    return [SoftStop(joint, limits[key], way, said) for key, way in ends if key in limits]


class PointSpring:
    """Pulls two points together with k (l - rest) + d l'; ask after ``Tree.move``.

    A cord is slack where it is shorter than at rest, and never pushes.
    """

    def __init__(self, tree: Tree, said: Mapping[str, Any]) -> None:
        only(said, "springs", "name", "frames", "points", "stiffness", "rest_length", "damping",
             "tension_only")  # fmt: skip
        pairs = zip(said["frames"], said.get("points", [(0, 0, 0)] * 2), strict=True)
        self._ends = [Point(tree, *pair) for pair in pairs]
        self.k, self.rest = said["stiffness"], said.get("rest_length", 0.0)
        self.d = said.get("damping", 0.0)
        self.cord = bool(said.get("tension_only", False))

    def kinks(self, v: Array) -> tuple[float, ...]:
        """What changes a cord where it goes through zero."""
        _, longer, rate = self._stretch(v)
        if not self.cord:
            return ()
        return (longer, longer + self.d / self.k * rate) if self.d else (longer,)

    def act(self, v: Array, signs: Array) -> tuple[Array, float, float]:
        """Torques [N m], energy [J] and heat [W]."""
        row, longer, rate = self._stretch(v)
        if self.cord and signs[0] < 0.0:
            return 0.0 * row, 0.0, 0.0
        pull = self.k * longer + self.d * rate
        if self.cord and signs[-1] < 0.0:
            pull = 0.0
        return -pull * row, 0.5 * self.k * longer**2, (pull - self.k * longer) * rate

    def _stretch(self, v: Array) -> tuple[Array, float, float]:
        """How the length depends on q, how much longer than at rest it is, and how fast."""
        first, second = self._ends
        apart = first.place() - second.place()
        length = float(np.linalg.norm(apart))
        row = apart / length @ (first.jacobian() - second.jacobian())
        return row, length - self.rest, float(row @ v)
