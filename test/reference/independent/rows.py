# SPDX-License-Identifier: Apache-2.0
"""What constrains the motion: loops, which hold both ways, and what only pushes."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .description import only
from .tree import Point, Tree

Array = np.ndarray


class Row(NamedTuple):
    """φ(q), A = ∂φ/∂q of shape (n,), and dA/dt · v."""

    value: float
    A: Array
    bend: float


class Rod:
    """Two points keep their distance: φ = (|p|² - l²) / (2 l)."""

    def __init__(self, tree: Tree, said: Mapping[str, Any]) -> None:
        only(said, "distance", "type", "name", "frames", "points", "distance")
        pairs = zip(said["frames"], said["points"], strict=True)
        self._ends, self._length = [Point(tree, *pair) for pair in pairs], said["distance"]

    def at(self, q: Array, v: Array) -> Row:
        """The row at a state; after ``Tree.move``."""
        one, other = self._ends
        p, J = one.place() - other.place(), one.jacobian() - other.jacobian()
        rate = J @ v
        bend = rate @ rate + p @ (one.curvature() - other.curvature())
        value = 0.5 * (p @ p - self._length**2)
        return Row(value / self._length, p @ J / self._length, bend / self._length)


class Touch(NamedTuple):
    """Gap, and sliding: N, T with their bends; T has as many rows as there are ways to slide."""

    gap: float
    N: Array
    bend: float
    T: Array
    slide_bend: Array


class Contact:
    """A point that a plane of the world stops."""

    words = ("impact", "lifts", "grips", "rubs")

    def __init__(self, tree: Tree, said: Mapping[str, Any], q: Array) -> None:
        only(said, "contact", "type", "name", "frame", "point", "plane", "friction",
             "static_friction", "restitution")  # fmt: skip
        self._point = Point(tree, said["frame"], said.get("point", (0, 0, 0)))
        plane = said.get("plane", {})
        only(plane, "plane", "point", "normal")
        self._origin = np.array(plane.get("point", (0, 0, 0)), dtype=float)
        normal = np.array(plane.get("normal", (0, 0, 1)), dtype=float)
        self._n = normal / np.linalg.norm(normal)
        self.mu = said.get("friction", 0.0)
        self.mu_static = said.get("static_friction", self.mu)
        self.restitution = said.get("restitution", 0.0)
        first = np.cross(np.eye(3)[1], self._n)
        if np.linalg.norm(first) < 0.1:
            first = np.cross(np.eye(3)[2], self._n)
        first /= np.linalg.norm(first)
        self._t = (
            np.array([first, np.cross(self._n, first)]) if self.mu_static else np.empty((0, 3))
        )
        self._t = np.array([t for t in self._t if self._is_a_way(tree, t, q)]).reshape(-1, 3)

    def _is_a_way(self, tree: Tree, t: Array, q: Array) -> bool:
        """Whether the point can move along t at all: it cannot across a planar arm."""
        rng = np.random.default_rng(0)
        for _ in range(3):
            tree.move(q + rng.normal(size=tree.n), np.zeros(tree.n))
            if np.abs(t @ self._point.jacobian()).max() > 1e-9:
                return True
        return False

    def at(self, q: Array, v: Array) -> Touch:
        """The rows at a state; after ``Tree.move``."""
        J, bend = self._point.jacobian(), self._point.curvature()
        gap = float(self._n @ (self._point.place() - self._origin))
        return Touch(gap, self._n @ J, float(self._n @ bend), self._t @ J, self._t @ bend)


class Stop:
    """One end of a joint's range, rigid and without friction."""

    mu = mu_static = 0.0
    words = ("hit", "leaves", "holds", "holds")

    def __init__(self, joint: int, n: int, at: float, way: int, restitution: float) -> None:
        self._joint, self._at, self._way, self.restitution = joint, at, way, restitution
        self._N = way * np.eye(n)[joint]

    def at(self, q: Array, v: Array) -> Touch:
        """The rows at a state."""
        gap = self._way * (q[self._joint] - self._at)
        return Touch(float(gap), self._N, 0.0, np.empty((0, len(q))), np.empty(0))


def stops(joint: int, n: int, limits: Mapping[str, Any]) -> list[Stop]:
    """The ends of a joint's range: rigid, unless ``stop`` is false."""
    said = limits.get("stop", True)
    if said is False:
        return []
    said = {} if said is True else said
    if "stiffness" in said:
        return []  # soft: a law, and no row
    only(said, "stop", "restitution")
    ends = [("lower", 1), ("upper", -1)]
    e = said.get("restitution", 0.0)
    return [Stop(joint, n, limits[key], way, e) for key, way in ends if key in limits]
