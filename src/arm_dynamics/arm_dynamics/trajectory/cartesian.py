# SPDX-License-Identifier: Apache-2.0
"""Straight lines and circles of a frame in the world, and their timing.

A path gives the frame's placement over u in [0, 1] and its first two derivatives; the rotation
turns about one fixed axis at constant rate in u (slerp; Shoemake, "Animating rotation with
quaternion curves", SIGGRAPH 1985).
"""

from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, unit_vector, vector
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.task_space.inverse_kinematics import checked_pose
from arm_dynamics.task_space.task_space import Pose
from arm_dynamics.trajectory.reference import TaskReference
from arm_dynamics.trajectory.timing.laws import Quintic, Timing, Trapezoid


@frozen
class PathPoint(Pose):
    """Placement on a path and its derivatives in u.

    Attributes:
        first: First derivative, linear and angular, in axes of the world, shape (6,).
        second: Second derivative, likewise, shape (6,).
    """

    first: Array
    second: Array


class Path(Protocol):
    """A path in space over u in [0, 1]."""

    @property
    def length(self) -> float:
        """Way of the origin in [m], or the angle in [rad] where it only turns."""

    def at(self, u: float) -> PathPoint:
        """Placement and derivatives at ``u``."""


@frozen
class Line:
    """A straight line between two poses with uniform rotation; see ``line``.

    Attributes:
        start: The first pose.
        step: From the first position to the second in [m], shape (3,).
        turn: Rotation vector from the first orientation to the second in [rad], shape (3,).
    """

    start: Pose
    step: Array
    turn: Array

    @property
    def length(self) -> float:
        """Way of the origin in [m], or the angle in [rad] where it only turns."""
        distance = float(np.linalg.norm(self.step))
        return distance if distance > 1e-9 else float(np.linalg.norm(self.turn))

    def at(self, u: float) -> PathPoint:
        """Placement and derivatives at ``u``."""
        rotation = pin.exp3(u * self.turn) @ self.start.rotation
        first = np.concatenate([self.step, self.turn])
        return PathPoint(self.start.position + u * self.step, rotation, first, np.zeros(6))


@frozen
class Circle:
    """An arc about an axis; see ``circle``.

    Attributes:
        start: The first pose.
        centre: A point of the axis in [m], shape (3,).
        axis: Direction of the axis, of unit length, shape (3,).
        angle: Angle of the arc in [rad].
        turn: Rotation vector of the frame's own rotation along it in [rad], shape (3,).
    """

    start: Pose
    centre: Array
    axis: Array
    angle: float
    turn: Array

    @property
    def length(self) -> float:
        """Length of the origin's path in [m]."""
        return float(abs(self.angle) * np.linalg.norm(self.start.position - self.centre))

    def at(self, u: float) -> PathPoint:
        """Placement and derivatives at ``u``."""
        revolution = pin.exp3(u * self.angle * self.axis)
        radius = revolution @ (self.start.position - self.centre)
        rate = self.angle * self.axis
        velocity = np.cross(rate, radius)
        first = np.concatenate([velocity, self.turn])
        second = np.concatenate([np.cross(rate, velocity), np.zeros(3)])
        rotation = pin.exp3(u * self.turn) @ self.start.rotation
        return PathPoint(self.centre + radius, rotation, first, second)


def line(start: Pose, end: Pose) -> Line:
    """A straight line with uniform rotation in the shorter direction.

    Args:
        start: Pose at u = 0.
        end: Pose at u = 1.

    Raises:
        InvalidInput: If a pose is invalid, or both are the same.
    """
    start, end = checked_pose(start), checked_pose(end)
    turn = pin.log3(end.rotation @ start.rotation.T)
    straight = Line(start, end.position - start.position, turn)
    if straight.length < 1e-9:
        raise InvalidInput(
            f"start and end are the same, {start.position}; allowed: different poses"
        )
    return straight


def circle(
    start: Pose, centre: ArrayLike, axis: ArrayLike, angle: float, turning: bool = False
) -> Circle:
    """An arc.

    Args:
        start: Pose at u = 0.
        centre: Centre in [m], shape (3,), in the plane of the circle.
        axis: Axis of the circle, right-handed, shape (3,), not zero.
        angle: Angle of the arc in [rad]; 2π for a full circle.
        turning: Whether the frame rotates with the arc; otherwise it keeps its orientation.

    Raises:
        InvalidInput: If a number is not allowed, or the centre lies outside the plane.
    """
    start, origin = checked_pose(start), vector("centre", centre, 3)
    unit_axis = unit_vector("axis", axis, 3)
    arm = start.position - origin
    radius = float(np.linalg.norm(arm))
    if radius < 1e-9 or not 0.0 < abs(angle) < np.inf:
        raise InvalidInput(f"radius = {radius} m, angle = {angle}: neither may be zero")
    distance = abs(float(arm @ unit_axis))
    if distance > 1e-6 * radius:
        raise InvalidInput(
            f"the centre {origin} is {distance:.3g} m beside the plane through {start.position} "
            f"across the axis {unit_axis}; allowed: centres in that plane"
        )
    turn = angle * unit_axis if turning else np.zeros(3)
    return Circle(start, origin, unit_axis, float(angle), turn)


@frozen
class CartesianTrajectory:
    """A path with a timing: references for controllers in task space.

    Attributes:
        path: The path.
        timing: Its timing.
    """

    path: Path
    timing: Timing

    @property
    def duration(self) -> float:
        """Duration in [s]."""
        return self.timing.duration

    def sample(self, t: float) -> TaskReference:
        """Reference of the frame at the time ``t`` in [s]."""
        u, du, ddu = self.timing.at(t)
        place = self.path.at(u)
        velocity, acceleration = place.first * du, place.second * du**2 + place.first * ddu
        return TaskReference(place.position, place.rotation, velocity, acceleration)


def timed(
    path: Path, speed: float, acceleration: float, profile: str = "quintic"
) -> CartesianTrajectory:
    """Time a path by the largest speed and acceleration along it.

    Args:
        path: The path.
        speed: Largest speed in [m/s] ([rad/s] for a pure rotation).
        acceleration: Largest acceleration along the path in [m/s²] ([rad/s²]).
        profile: ``quintic`` or ``trapezoid``.

    Raises:
        InvalidInput: If a number or the profile is not allowed.
    """
    profiles: dict[str, type[Quintic | Trapezoid]] = {"quintic": Quintic, "trapezoid": Trapezoid}
    if profile not in profiles:
        raise InvalidInput(f"profile = {profile!r}; allowed: quintic, trapezoid")
    return CartesianTrajectory(path, profiles[profile].within(path.length, speed, acceleration))
