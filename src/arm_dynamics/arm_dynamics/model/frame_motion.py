# SPDX-License-Identifier: Apache-2.0
"""Motion of one frame, from Pinocchio; arguments are not validated, as in ``RigidTerms``."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, choices, known_names, plain
from arm_dynamics.model.robot import Robot

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_NAMES = "local", "world", "local_world_aligned"
_REFERENCES = {name: getattr(pin.ReferenceFrame, name.upper()) for name in _NAMES}


class MovingFrame(NamedTuple):
    """A frame at a position and velocity of the joints.

    Attributes:
        position: Position of its origin in the world in [m], shape (3,).
        rotation: Rotation from its axes to the world's, shape (3, 3).
        jacobian: J, shape (6, n).
        jacobian_rate: J̇, shape (6, n).
    """

    position: Array
    rotation: Array
    jacobian: Array
    jacobian_rate: Array


class FrameMotion:
    """Placement, Jacobian and its rate of one frame, for single states of shape (n,).

    Args:
        robot: The robot; used from one thread only.
        frame: Name of a frame; J of one that does not move is zero.
        reference: ``local``, ``world`` or ``local_world_aligned``, as in Pinocchio.

    Raises:
        InvalidInput: If the frame or reference is unknown.
    """

    def __init__(self, robot: Robot, frame: str, reference: str) -> None:
        check_frame(robot, frame, robot.frame_names)
        self._robot, self._pin, self._data = robot, robot.pin, pin.Data(robot.pin)
        self._frame = robot.frame_index(frame)
        if reference not in _REFERENCES:
            allowed = choices(reference, _REFERENCES)
            raise InvalidInput(f"reference = {reference!r}; allowed: {allowed}")
        self._reference = _REFERENCES[reference]

    def placement(self, q: Array) -> tuple[Array, Array]:
        """Position in [m], shape (3,), and rotation, shape (3, 3), of the frame in the world."""
        pin.forwardKinematics(self._pin, self._data, self._robot.configuration(q))
        return self._placement()

    def pose(self, q: Array) -> Array:
        """Homogeneous transformation from the frame's axes to the world's, shape (4, 4)."""
        pin.forwardKinematics(self._pin, self._data, self._robot.configuration(q))
        placement = pin.updateFramePlacement(self._pin, self._data, self._frame)
        return np.asarray(placement.homogeneous)

    def of_point(self, q: Array, point: ArrayLike, offset: ArrayLike) -> tuple[Array, Array]:
        """Position of a point that the frame carries, shape (3,), and J there, shape (6, n).

        Args:
            q: Joint positions, shape (n,).
            point: The point in the frame's axes in [m], shape (3,).
            offset: Vector from there in the world's axes in [m], likewise.
        """
        p, R = self.placement(q)
        r, J = R @ np.asarray(point) + offset, self.jacobian(q)
        return p + r, np.vstack([J[:3] - pin.skew(r) @ J[3:], J[3:]])

    def jacobian(self, q: Array) -> Array:
        """J of shape (6, n), linear rows first: velocity of the frame is J v."""
        full = self._robot.configuration(q)
        J = pin.computeFrameJacobian(self._pin, self._data, full, self._frame, self._reference)
        return self._gather(J)

    def moving(self, q: Array, v: Array) -> MovingFrame:
        """The frame, its Jacobian and its rate."""
        model, data, frame = self._pin, self._data, (self._frame, self._reference)
        full = self._robot.expanded(q, v)
        pin.computeJointJacobiansTimeVariation(model, data, *full)
        J = self._gather(pin.getFrameJacobian(model, data, *frame))
        J_dot = self._gather(pin.getFrameJacobianTimeVariation(model, data, *frame))
        return MovingFrame(*self._placement(), J, J_dot)

    def accelerated(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        """Position, rotation, velocity and acceleration, shapes (3,), (3, 3), (6,) and (6,).

        The last two are J v and J a + J̇ v, in world axes at the frame's origin.
        """
        model, data, index, axes = self._pin, self._data, self._frame, _ALIGNED
        pin.forwardKinematics(model, data, *self._robot.expanded(q, v, a))
        velocity = pin.getFrameVelocity(model, data, index, axes).vector
        acceleration = pin.getFrameClassicalAcceleration(model, data, index, axes).vector
        return *self._placement(), velocity, acceleration

    def _placement(self) -> tuple[Array, Array]:
        placement = pin.updateFramePlacement(self._pin, self._data, self._frame)
        return placement.translation.copy(), placement.rotation.copy()

    def _gather(self, J: Array) -> Array:
        # Pinocchio returns a single column as a vector.
        return self._robot.gather(J if J.ndim == 2 else J.reshape(6, -1))


def check_moving(robot: Robot, frame: str) -> None:
    """Refuse a frame that is unknown, or that no joint moves."""
    movable = [name for name in robot.frame_names if robot.frame(name).parentJoint > 0]
    check_frame(robot, frame, movable)
    if robot.frame(frame).parentJoint == 0:
        raise InvalidInput(f"frame '{frame}' does not move; allowed: {known_names(movable)}")


def check_frame(robot: Robot, frame: str, allowed: Sequence[str]) -> None:
    """Refuse a frame that does not exist, naming those that are ``allowed``."""
    if not robot.has_frame(frame):
        names = choices(frame, allowed)
        raise InvalidInput(f"frame '{plain(frame, 80)}' does not exist; allowed: {names}")
