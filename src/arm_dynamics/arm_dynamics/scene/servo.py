# SPDX-License-Identifier: Apache-2.0
"""Keys of the servos that follow commanded positions and velocities."""

from __future__ import annotations

from pydantic import model_validator

from arm_dynamics.scene.types import Part, Positive


class Servo(Part):
    """The servo of one joint, used where the joint is commanded a position or velocity.

    Attributes:
        bandwidth: ω in [rad/s] of the error dynamics ë + 2 ζ ω ė + ω² e = 0; by default 100, lower
            for long ticks and flexible transmissions.
        damping_ratio: Damping ratio ζ; 1 is critical.
        stiffness: Stiffness in [N m/rad] or [N/m], in place of a bandwidth.
        damping: Damping in [N m s/rad] or [N s/m], with a stiffness; by default by the damping
            ratio and the inertia of the joint at the start.
    """

    bandwidth: Positive | None = None
    damping_ratio: Positive = 1.0
    stiffness: Positive | None = None
    damping: Positive | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Servo:
        if self.stiffness is not None and self.bandwidth is not None:
            raise ValueError("a servo has a bandwidth or a stiffness, not both")
        if self.damping is not None and self.stiffness is None:
            raise ValueError(
                "damping belongs to a stiffness; with a bandwidth it is damping_ratio"
            )
        return self
