# SPDX-License-Identifier: Apache-2.0
"""Computed torque: inverse dynamics of the reference's acceleration and feedback."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.attributes import sealed
from arm_dynamics.control.law import JointLaw, Parts
from arm_dynamics.control.pole_placement import held_gains
from arm_dynamics.dynamics.dynamics import Dynamics, model_of
from arm_dynamics.equations.elementary import choose, sign
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.rigid_expressions import RigidExpressions
from arm_dynamics.trajectory.reference import Reference


@sealed
class ComputedTorque(JointLaw):
    """Computed torque: τ = ID(q, q̇, q̈_d + K_d ė + K_p e), with e = q_d − q.

    With an exact model every joint's error obeys ë + 2 ζ ω ė + ω² e = 0 (Craig, Introduction to
    Robotics, section 10.4). A torque that is held for a tick acts half a tick late; so inverse
    dynamics is taken for the middle of the tick, and the gains are those whose error, seen at the
    ticks, falls as that equation says (``held_gains``). With dt = 0 they are the textbooks',
    K_p = ω² and K_d = 2 ζ ω.

    Dry friction of a joint at rest is compensated in the direction of the reference, since the
    joint's own motion has no direction. The error equation does not hold while actuators saturate,
    and only feedback counteracts model errors.
    """

    def __init__(
        self, dynamics: Dynamics | ArmModel, bandwidth: ArrayLike = 20.0,
        damping_ratio: ArrayLike = 1.0, dt: float = 1e-3,
    ) -> None:  # fmt: skip
        """Choose gains.

        Args:
            dynamics: The model; used from one thread only.
            bandwidth: ω in [rad/s], a number or shape (n,), not negative.
            damping_ratio: ζ, a number or shape (n,), not negative; 1 is critically damped.
            dt: Time in [s] for which a torque is held, 0 for none.

        Raises:
            InvalidInput: If a gain or dt has a wrong shape or value.
        """
        model = model_of(dynamics)
        super().__init__(model.n, model)
        self._friction = SteadyFriction.of(model)
        self.tuning = *held_gains(bandwidth, damping_ratio, self._n, dt), np.array([float(dt)])

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """τ for the acceleration q̈_d + K_d ė + K_p e; see ``JointLaw.formula``."""
        kp, kd, dt = tuning
        a = desired.a + kd * (desired.v - v) + kp * (desired.q - q)
        sliding = sign(choose(v == 0.0, desired.v, v))
        return held_torque(rigid.frictionless, self._friction, (q, v, a), sliding, dt), memory


def held_torque(
    inverse: Callable[[Any, Any, Any], Any], friction: SteadyFriction, motion: Sequence[Any],
    sliding: Any, dt: Any,
) -> Any:  # fmt: skip
    """Torque for an acceleration that is held for a tick: that of the middle of the tick.

    Args:
        inverse: M a + C v + G + S of positions, velocities and accelerations.
        friction: Friction that is added to it.
        motion: Joint positions in [rad] or [m], velocities and accelerations at the beginning of
            the tick, arrays or expressions of shape (n,).
        sliding: Direction in which joints slide, -1 to 1, likewise; None for that of the motion in
            the middle of the tick.
        dt: Time in [s] for which the torque is held.

    Returns:
        Joint torques in [N m] or [N], shape (n,).
    """
    q, v, a = motion
    middle, speed = q + 0.5 * dt * v, v + 0.5 * dt * a
    sliding = sign(speed) if sliding is None else sliding
    return friction.overcome(inverse(middle, speed, a), speed, sliding, middle)


def law_in_c(model: ArmModel) -> ca.Function:
    """The law for exported libraries: gains are inputs, friction has the direction of the motion.

    Returns:
        CasADi function of arguments with their names in C, -> torques of shape (n,): that of the
        middle of a tick dt, in which joints slide as they move then, at rest, too.
    """
    names = "q", "v", "q_d", "v_d", "a_d", "kp", "kd", "dt"
    symbols = [ca.SX.sym(name, 1 if name == "dt" else model.n) for name in names]
    q, v, q_d, v_d, a_d, kp, kd, dt = symbols
    motion = q, v, a_d + kd * (v_d - v) + kp * (q_d - q)
    inverse, friction = RigidExpressions(model).frictionless, SteadyFriction.of(model)
    tau = ca.densify(held_torque(inverse, friction, motion, None, dt))
    return ca.Function("term_computed_torque", symbols, [tau], names, ["tau"], {"cse": True})
