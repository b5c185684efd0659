# SPDX-License-Identifier: Apache-2.0
"""The springs of a robot: as data for the equations, and as numerical terms by Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.equations.frame import Frame
from arm_dynamics.equations.interpolation import Curve, chords
from arm_dynamics.equations.spring import Springs, stored, tension
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.robot import Robot, velocity_index
from arm_dynamics.model.tree_builder import frame_of
from arm_dynamics.scene.spring import DeflectionTable, spring_name


def springs_of(robot: Robot) -> Springs:
    """Describe the scene's springs; that of a mimic joint acts on its leader.

    Raises:
        SceneError: If a stiffness is missing, or a spring connects frames that cannot move
            relative to each other.
    """
    stiffness, rest, damping = map(read_only, _of_joints(robot))
    scene = robot.scene
    own = [scene.joint(name).spring for name in velocity_index(robot.pin)]
    tables = tuple(_curve(spring.table) if spring else None for spring in own)
    return Springs(stiffness, rest, damping, tables, scene.springs, _frames(robot))


def _curve(table: DeflectionTable | None) -> Curve | None:
    if table is None:
        return None
    at, torque = np.array(table.deflection), np.array(table.torque)
    steep = chords(at, torque)
    return Curve.through(at, torque, ends=(steep[0], steep[-1]))


def _of_joints(robot: Robot) -> Array:
    """Stiffness, rest position and damping of each of Pinocchio's joints, shape (3, joints)."""
    scene, names = robot.scene, list(velocity_index(robot.pin))
    numbers = np.zeros((3, len(names)))
    for column, name in zip(numbers.T, names, strict=True):
        if (spring := scene.joint(name).spring) is None:
            continue
        if spring.stiffness is None and spring.table is None:
            raise SceneError(
                f"scene: 'joints.{name}.spring.stiffness' is missing: a number of at least zero "
                "is expected"
            )
        column[:] = spring.stiffness or 0.0, spring.rest, spring.damping
    return numbers


def _frames(robot: Robot) -> dict[str, Frame]:
    """The frames of springs between points."""
    springs = robot.scene.springs
    frames = {name: frame_of(robot, name) for spring in springs for name in spring.frames}
    for i, spring in enumerate(springs):
        first, second = spring.frames
        if frames[first].link == frames[second].link:
            raise SceneError(
                f"scene: spring '{spring_name(spring, i)}' is between '{first}' and '{second}', "
                "which cannot move relative to each other: no joint is between them, or all of "
                "them are locked"
            )
    return frames


class SpringTerms:
    """S(q, v) and the springs' energy, for single states of shape (n,).

    Positions and Jacobians of the points come from Pinocchio, independently of
    ``equations.spring``; the spring laws are the same.

    Args:
        robot: The robot; used from one thread only.
    """

    def __init__(self, robot: Robot) -> None:
        self.springs = springs_of(robot)
        self._robot = robot

    @cached_property
    def _data(self) -> pin.Data:
        return pin.Data(self._robot.pin)

    def torque(self, q: Array, v: Array) -> Array:
        """S in [N m] or [N], shape (n,)."""
        if not self.springs:
            return np.zeros(self._robot.n)
        springs, robot = self.springs, self._robot
        bent, rate = q @ robot.followers.T + robot.offsets - springs.rest, robot.spread(v)
        S = robot.gather(springs.pull(bent) + springs.damping * rate)
        for spring, (d, J) in zip(springs.points, self._ways(q), strict=True):
            slope = J.T @ d
            S = S + sum(tension(spring, d @ d, slope @ v)) * slope
        return np.asarray(S)

    def energy(self, q: Array) -> float:
        """Energy stored in the springs in [J]."""
        springs, robot = self.springs, self._robot
        bent = q @ robot.followers.T + robot.offsets - springs.rest
        ways = zip(springs.points, self._ways(q), strict=True)
        between = sum(float(stored(spring, d @ d)) for spring, (d, _) in ways)
        return float(springs.stored(bent).sum()) + between

    def _ways(self, q: Array) -> list[tuple[Array, Array]]:
        """Vector from each spring's second point to its first, in world axes, and its Jacobian."""
        if not self.springs.points:
            return []
        model, data = self._robot.pin, self._data
        pin.computeJointJacobians(model, data, self._robot.configuration(q))
        pin.updateFramePlacements(model, data)
        ways = []
        for spring in self.springs.points:
            (a, J_a), (b, J_b) = map(self._point, spring.frames, spring.points)
            ways.append((a - b, J_a - J_b))
        return ways

    def _point(self, frame: str, point: Sequence[float]) -> tuple[Array, Array]:
        """Position of a point of a frame in the world in [m], shape (3,), and its Jacobian."""
        model, data = self._robot.pin, self._data
        index = self._robot.frame_index(frame)
        M, axes = data.oMf[index], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        r = M.rotation @ np.array(point)
        J = self._robot.gather(pin.getFrameJacobian(model, data, index, axes).reshape(6, -1))
        return M.translation + r, J[:3] - pin.skew(r) @ J[3:]
