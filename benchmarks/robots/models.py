# SPDX-License-Identifier: Apache-2.0
"""The robots that are measured, each as one URDF text that every simulator reads."""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
import pinocchio as pin

from arm_dynamics import load_scene
from benchmarks.robots.urdf import chain_urdf, plain_urdf, single_coordinate


@dataclass(frozen=True)
class Robot:
    """A robot, its start, and the duration for which its free motion is compared."""

    name: str  # as shown in tables
    urdf: str  # plain URDF text, the same for every simulator
    q0: np.ndarray = field(repr=False)  # start position, shape (n,) [rad]; it starts at rest
    duration: float = 1.0  # of the free motion [s]

    @property
    def n(self) -> int:
        return len(self.q0)

    @cached_property
    def pin(self) -> pin.Model:
        """The model in Pinocchio, the authority for its dynamics; one coordinate a joint."""
        return pin.buildModelFromXML(single_coordinate(self.urdf))


@lru_cache
def panda() -> Robot:
    """Franka Panda with its fingers locked, 7 joints, released from its ready posture."""
    locked = ["panda_finger_joint1", "panda_finger_joint2"]
    model = _installed("panda_description/urdf/panda.urdf", locked)
    q0 = np.deg2rad([0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0])
    return Robot("Panda", plain_urdf(model), q0)


@lru_cache
def ur10() -> Robot:
    """Universal Robots UR10, 6 joints, released with a bent elbow."""
    model = _installed("ur_description/urdf/ur10_robot.urdf", [])
    q0 = np.deg2rad([0.0, -60.0, 90.0, -30.0, 60.0, 0.0])
    return Robot("UR10", plain_urdf(model), q0)


@lru_cache
def chain(links: int) -> Robot:
    """A hanging chain of ``links`` rods, released with every joint bent by 0.3 rad."""
    return Robot(f"Chain {links}", chain_urdf(links), np.full(links, 0.3))


def _installed(urdf: str, locked: list[str]) -> pin.Model:
    text = load_scene(f"package://example-robot-data/robots/{urdf}").robot.urdf
    full = pin.buildModelFromXML(text)
    ids = [full.getJointId(name) for name in locked]
    return pin.buildReducedModel(full, ids, pin.neutral(full))
