# SPDX-License-Identifier: Apache-2.0
"""Limits that a trajectory must not exceed."""

from __future__ import annotations

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.model.arm import ArmModel

# Units of joints that turn and that slide
_UNITS = {
    "position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "acceleration": ("rad/s²", "m/s²"),
    "effort": ("N m", "N"), "voltage": ("V", "V"),
}  # fmt: skip


@frozen
class Limits:
    """Limits of a trajectory; infinite where there is none.

    Attributes:
        velocity: Largest speed in [rad/s] or [m/s], shape (n,).
        acceleration: Largest acceleration in [rad/s²] or [m/s²], shape (n,).
        lower: Lowest position in [rad] or [m], shape (n,).
        upper: Highest position in [rad] or [m], shape (n,).
        joint_names: Names for messages; numbers are used when empty.
        joint_types: Types as in ``ArmModel``, for units in messages; without units when empty.
    """

    velocity: Array
    acceleration: Array
    lower: Array
    upper: Array
    joint_names: tuple[str, ...] = ()
    joint_types: tuple[str, ...] = ()

    @classmethod
    def of(cls, model: ArmModel, acceleration: float = np.inf) -> Limits:
        """Take the limits of a robot.

        Args:
            model: An ``ArmModel``.
            acceleration: Largest acceleration of every joint in [rad/s²] or [m/s²].

        Returns:
            Velocity and position limits of the model, and this acceleration.
        """
        return cls(
            velocity=np.where(model.velocity_limit > 0.0, model.velocity_limit, np.inf),
            acceleration=np.full(model.n, float(acceleration)),
            lower=model.position_lower,
            upper=model.position_upper,
            joint_names=model.joint_names,
            joint_types=model.joint_types,
        )

    def name(self, joint: int) -> str:
        """Return the name of joint number ``joint`` for a message."""
        return self.joint_names[joint] if self.joint_names else f"number {joint}"

    def unit(self, joint: int, quantity: str) -> str:
        """Return the unit of a joint's quantity after a space, for a message."""
        if not self.joint_types:
            return ""
        turning, sliding = _UNITS[quantity]
        return f" {sliding if self.joint_types[joint] == 'prismatic' else turning}"
