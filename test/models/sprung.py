# SPDX-License-Identifier: Apache-2.0
"""Springs by their potential alone: lengths from Pinocchio's placements, forces by differences.

Nothing is shared with the code under test but the scene, which is plain data.
"""

from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from arm_dynamics import Scene
from models.oracle import Oracle
from reference.independent.tree import Point

Array = np.ndarray
NUMBERS = ("stiffness", "rest", "damping")
# Central differences of eighth order (Fornberg, Math. Comp. 51, 1988).
WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}


def slope(f: Callable[[Array], float], x: Array, h: float = 5e-3) -> Array:
    """Gradient of a function at ``x``, shape (n,)."""
    steps = h * np.eye(len(x))
    return np.array(
        [sum(w * (f(x + k * e) - f(x - k * e)) for k, w in WEIGHTS.items()) / h for e in steps]
    )


class SprungOracle(Oracle):
    """The robot of an ``Oracle`` with its scene's springs."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.scene = scene
        given = [scene.joint(name).spring for name in self.every]
        self.k = np.array([s.stiffness if s else 0.0 for s in given])
        self.rest = np.array([s.rest if s else 0.0 for s in given])
        self.d = np.array([s.damping if s else 0.0 for s in given])

    def length(self, spring: Any, q: Array) -> float:
        """Of a spring between points in [m]."""
        pin.framesForwardKinematics(self.model, self.data, self.full(q))
        ends = zip(spring.frames, spring.points, strict=True)
        one, other = (Point(self, *end).place() for end in ends)
        return float(np.linalg.norm(one - other))

    def elastic(self, spring: Any, q: Array) -> float:
        """Its tension but for the damper in [N]."""
        pull = spring.stiffness * (self.length(spring, q) - spring.rest_length) + spring.force
        return max(0.0, pull) if spring.tension_only else pull

    def bent(self, q: Array) -> float:
        """Energy of all springs in [J], those between points linear and taut."""
        stored = 0.5 * self.k @ (self.P @ q + self.c - self.rest) ** 2
        for spring in self.scene.springs:
            L = self.length(spring, q)
            stored += 0.5 * spring.stiffness * (L - spring.rest_length) ** 2 + spring.force * L
        return float(stored)

    def spring(self, q: Array, v: Array) -> Array:
        """S(q, v) in [N m] or [N], shape (n,)."""
        bent = self.P @ q + self.c - self.rest
        S = self.P.T @ (self.k * bent + self.d * (self.P @ v))
        for spring in self.scene.springs:
            away = slope(lambda x, s=spring: self.length(s, x), q)
            elastic, damping = self.elastic(spring, q), spring.damping * (away @ v)
            if spring.tension_only:
                damping = max(damping, -elastic) if elastic > 0.0 else 0.0
            S = S + (elastic + damping) * away
        return np.asarray(S)

    def rigid(self, q: Array, v: Array, a: Array) -> Array:
        """Torques without friction, springs included."""
        return super().rigid(q, v, a) + self.spring(q, v)


def sprung(
    urdf: str, rng: np.random.Generator, count: int = 3, cord: bool = False
) -> dict[str, Any]:
    """A scene with springs of all joints and ``count`` between points of random links."""
    moving = [j for j in ElementTree.fromstring(urdf).findall("joint") if j.get("type") != "fixed"]
    links = ["world", *(str(joint.find("child").get("link")) for joint in moving)]
    springs = [
        {
            "frames": rng.choice(links, 2, replace=False).tolist(),
            "points": rng.uniform(-0.5, 0.5, (2, 3)).tolist(),
            "stiffness": float(rng.uniform(50.0, 300.0)),
            "rest_length": float(rng.choice([0.0, 0.4])),
            "damping": float(rng.uniform(0.0, 5.0)),
            "force": float(rng.choice([0.0, -20.0, 30.0])),
            "tension_only": cord,
        }
        for _ in range(count)
    ]
    joints = {
        str(joint.get("name")): {"spring": dict(zip(NUMBERS, row, strict=True))}
        for joint, row in zip(
            moving, rng.uniform(0.0, 3.0, (len(moving), 3)).tolist(), strict=True
        )
    }
    return {"robot": {"urdf": urdf}, "joints": joints, "springs": springs}
