# SPDX-License-Identifier: Apache-2.0
"""References: the desired motion at an instant, over time, and at points to pass."""

from dataclasses import dataclass
from typing import Protocol

from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed


@sealed
@dataclass(frozen=True, slots=True)
class Reference:
    """Desired joint motion at an instant.

    Attributes:
        q: Positions in [rad] or [m], shape (n,).
        v: Velocities in [rad/s] or [m/s], shape (n,).
        a: Accelerations in [rad/s²] or [m/s²], shape (n,).
        tau: Torques in [N m] or [N] to add to the controller's, shape (n,); None for none.
    """

    q: Array
    v: Array
    a: Array
    tau: Array | None = None


@sealed
@dataclass(frozen=True, slots=True)
class TaskReference:
    """Desired motion of the frame in the world at an instant.

    Attributes:
        position: Position in [m], shape (3,).
        rotation: Rotation matrix of shape (3, 3).
        velocity: Linear and angular velocity in the world in [m/s] and [rad/s], shape (6,).
        acceleration: Acceleration, likewise, in [m/s²] and [rad/s²], shape (6,).
        force: Contact force along a controller's direction in [N].
        posture: Preferred joint positions in the null space of the task, shape (n,), or None.
    """

    position: Array
    rotation: Array
    velocity: Array
    acceleration: Array
    force: float = 0.0
    posture: Array | None = None


class Motion(Protocol):
    """References over time; at rest before the start and after the end."""

    @property
    def duration(self) -> float:
        """Duration in [s]."""

    def sample(self, t: float) -> Reference:
        """Position, velocity and acceleration at the time ``t`` in [s] from its start."""


@sealed
@dataclass(frozen=True, slots=True)
class Waypoint:
    """A point to pass at a time.

    Attributes:
        time: Time from the start of the trajectory in [s].
        q: Positions in [rad] or [m], shape (n,).
        v: Velocities there, or None to have them chosen.
        a: Accelerations there, or None to have them chosen.
        tau: Torques in [N m] or [N] to add to the controller's, or None for none; linear between
            waypoints and constant after the last.
    """

    time: float
    q: ArrayLike
    v: ArrayLike | None = None
    a: ArrayLike | None = None
    tau: ArrayLike | None = None
