# SPDX-License-Identifier: Apache-2.0
"""Total friction of an arm in steady motion, for inverse dynamics and controllers."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

from arm_dynamics.actuation.internal_state import FrictionLaw
from arm_dynamics.actuation.joint_laws import friction_laws
from arm_dynamics.attributes import frozen
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.friction.joint_friction import JointFriction

# Fixed-point iterations of ``overcome``: each leaves as much of the error as friction
# grows with the load
ITERATIONS = 40


@frozen
class SteadyFriction:
    """F of the equation of motion, models with states being in steady state.

    Arguments are joint velocities v in [rad/s] or [m/s], the direction in which joints slide or
    are about to, -1 to 1, positions q in [rad] or [m], used only if ``by_position``, and the
    drives' torques in [N m] or [N], used only if ``by_load``; each of shape (…, n), or an
    expression.

    Attributes:
        joints: Friction without states.
        laws: Friction models with states.
    """

    joints: JointFriction
    laws: tuple[FrictionLaw, ...]

    @classmethod
    def of(cls, model: ArmModel) -> SteadyFriction:
        """The friction of an arm."""
        return cls(model.friction, friction_laws(model))

    @cached_property
    def has_dry(self) -> bool:
        """Whether part of the friction changes sign with the direction."""
        return self.joints.has_dry or bool(self.laws)

    @cached_property
    def by_position(self) -> bool:
        """Whether the friction depends on the joints' positions."""
        return self.joints.by_position or self.joints.by_law.by_position

    @cached_property
    def by_load(self) -> bool:
        """Whether the friction depends on the drives' torques."""
        return self.joints.by_load or self.joints.by_law.by_load

    @cached_property
    def is_present(self) -> bool:
        """Whether there is any."""
        joints = self.joints
        viscous = joints.viscous.mean.any() or joints.viscous.skew.any()
        return bool(viscous or self.has_dry or any(joints.tables) or joints.gears)

    @cached_property
    def gearless(self) -> SteadyFriction:
        """Copy without the gears' losses."""
        return replace(self, joints=self.joints.gearless)

    def __call__(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Total friction, shape (…, n)."""
        smooth = self.joints.smooth(v, q)
        return smooth + self.dry(v, direction, q, load) if self.has_dry else smooth

    def dry(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """The part that changes sign with the direction."""
        if not self.laws:
            return self.joints.dry(v, direction, q, load)
        rest = self.joints.dry(v, direction, q, load) if self.joints.has_dry else 0.0
        return self.of_laws(v, direction, q, load) + rest

    def of_laws(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """The part of the models with states."""
        return sum((law.steady(v, direction, q, load) for law in self.laws), 0.0 * v)

    def overcome(self, rigid: Quantity, v: Quantity, direction: Quantity, q: Quantity) -> Quantity:
        """Torque that moves the rigid arm and overcomes the friction caused by that torque.

        Solves tau = g(rigid + F(v, q, tau)), where g is the torque that a gear requires to deliver
        its argument. A load-dependent factor makes F grow with tau, but more slowly than tau (see
        ``model.friction``), so the iteration converges.

        Args:
            rigid: M a + C v + G + S in [N m] or [N], shape (…, n).
            v: Joint velocities.
            direction: Direction in which joints slide; used only if ``has_dry``.
            q: Joint positions.

        Returns:
            Torques of the shape of ``rigid``.
        """
        friction, tau = self.gearless, rigid
        for _ in range(ITERATIONS + 1 if self.by_load else 1):
            tau = self.joints.gear_input(rigid + friction(v, direction, q, tau), direction)
        return tau
