# SPDX-License-Identifier: Apache-2.0
"""Feed-forward of friction from the reference's velocity, free of noise and chatter."""

from typing import Any

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import Controller
from arm_dynamics.control.law import LawInput, Parts, Wrapper
from arm_dynamics.equations.elementary import Quantity, hyperbolic_tangent
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.trajectory.reference import Reference

# Speed in [rad/s] or [m/s] over which the feed-forward of dry friction changes sign
BAND = 0.01


def friction_feed_forward(
    friction: SteadyFriction, v: Quantity, q: Quantity, load: Quantity, viscous: Quantity = None
) -> Quantity:
    """Friction torques of the model at a desired velocity, shape (n,).

    Arguments are arrays or expressions. Dry friction changes sign over ``BAND`` and is zero for a
    reference at rest.

    Args:
        friction: The model's.
        v: Joint velocities in [rad/s] or [m/s], shape (n,).
        q: Joint positions in [rad] or [m], for friction that depends on them, shape (n,).
        load: Torques of the drives in [N m] or [N], likewise.
        viscous: Coefficient in place of the model's mean of both directions; 0 leaves it out.
    """
    joints = friction.joints
    tau = joints.smooth(v, q, viscous)
    if friction.has_dry:
        sign = hyperbolic_tangent(v / BAND)
        tau = tau + friction.gearless.dry(v, sign, q, load)
        if joints.gears:
            tau = joints.gear_input(load + tau, sign) - load
    return tau


@sealed
class FrictionFeedForward(Wrapper):
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
        super().__init__(control, model.n)
        self._viscous = None if terms == "all" else 0.0
        self._friction = SteadyFriction.of(model)

    @property
    def key(self) -> tuple[Any, ...] | None:
        """What the formula depends on besides the model; see ``law.Law``."""
        key = super().key
        return None if key is None else (*key, self._viscous)

    def adapt(self, tau: Any, inputs: LawInput, tuning: Parts, memory: Parts) -> tuple[Any, Parts]:
        """The controller's torques and friction."""
        v, q = inputs.desired.v, inputs.desired.q
        return tau + friction_feed_forward(self._friction, v, q, tau, self._viscous), memory
