# SPDX-License-Identifier: Apache-2.0
"""Feed-forward of friction from the reference's velocity, free of noise and chatter."""

from __future__ import annotations

import numpy as np

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.control.computed_torque import Controller, Moving
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.trajectory.reference import Reference

BAND = 0.01
"""Speed in [rad/s] or [m/s] over which the feed-forward of dry friction changes sign."""


def ahead(
    friction: SteadyFriction, v: Array, q: Array, load: Array, viscous: bool = True
) -> Array:
    """Friction torques of the model at a desired velocity, shape (n,).

    Dry friction changes sign over ``BAND`` and is zero for a reference at rest.

    Args:
        friction: The model's.
        v: Joint velocities in [rad/s] or [m/s], shape (n,).
        q: Joint positions in [rad] or [m], for friction that depends on them, shape (n,).
        load: Torques of the drives in [N m] or [N], likewise.
        viscous: Whether viscous friction is part of it.
    """
    joints = friction.joints
    tau = joints.smooth(v) if viscous else np.zeros_like(v)
    if friction.has_dry:
        way = np.tanh(v / BAND)
        tau = tau + friction.gearless.dry(v, way, q, load)
        tau = joints.gear_input(load + tau, way) - load if joints.gears else tau
    return np.asarray(tau)


class FrictionFeedForward:
    """A joint controller with the friction of the reference's motion added."""

    def __init__(
        self, control: Controller[Reference], model: ArmModel, terms: str = "all"
    ) -> None:
        """Choose the terms to add.

        Args:
            control: Any joint controller.
            model: The model whose friction it is.
            terms: ``all``, or ``dry`` for controllers that compensate viscous friction already
                (``FeedForwardPD``, ``JointImpedance``).

        Raises:
            InvalidInput: If ``terms`` is something else.
        """
        if terms not in ("all", "dry"):
            raise InvalidInput(f"terms = {terms!r}; allowed: all, dry")
        self._control, self._viscous = control, terms == "all"
        self._friction = SteadyFriction.of(model)

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        tau = self._control.torque(state, reference)
        return tau + ahead(self._friction, reference.v, reference.q, tau, self._viscous)
