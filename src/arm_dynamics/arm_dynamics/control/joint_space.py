# SPDX-License-Identifier: Apache-2.0
"""Controllers in joint space; see ``controller`` for the common interface."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive, positive_limits
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import ArmState, checked
from arm_dynamics.control.law import JointLaw, Parts
from arm_dynamics.control.pole_placement import gain
from arm_dynamics.dynamics.dynamics import Dynamics, model_of
from arm_dynamics.equations.elementary import clipped, diagonal, root
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.reference import Reference


def feedback(q: Any, v: Any, desired: Reference, kp: Any, kd: Any) -> Any:
    """K_p e + K_d ė, for numbers and expressions."""
    return kp * (desired.q - q) + kd * (desired.v - v)


@sealed
class PD(JointLaw):
    """Springs and dampers alone: τ = K_p e + K_d ė. Gravity causes a steady-state error."""

    def __init__(self, n: int, kp: ArrayLike, kd: ArrayLike) -> None:
        """Choose gains.

        Args:
            n: Degrees of freedom.
            kp: K_p in [N m/rad] or [N/m], a number or shape (n,), not negative.
            kd: K_d in [N m s/rad] or [N s/m], likewise.

        Raises:
            InvalidInput: If a gain has a wrong shape or value.
        """
        super().__init__(n)
        self.tuning = gain("kp", kp, n), gain("kd", kd, n)

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """τ = K_p e + K_d ė; see ``JointLaw.formula``."""
        return feedback(q, v, desired, *tuning), memory


@sealed
class PID(JointLaw):
    """τ = K_p e + K_d ė + ∫ K_i e dt, clipped at the limits, with anti-windup.

    If a torque is clipped, the integral is reduced by the excess with the time constant K_p / K_i
    (back-calculation; Åström and Hägglund, Advanced PID Control, 2006, section 3.5).
    """

    def __init__(
        self, n: int, kp: ArrayLike, ki: ArrayLike, kd: ArrayLike, dt: float,
        limit: ArrayLike = np.inf,
    ) -> None:  # fmt: skip
        """Choose gains.

        Args:
            n: Degrees of freedom.
            kp: K_p in [N m/rad] or [N/m], a number or shape (n,), not negative; positive where
                ki is.
            ki: K_i in [N m/(rad s)] or [N/(m s)], likewise, not negative.
            kd: K_d in [N m s/rad] or [N s/m], likewise, not negative.
            dt: Time between calls in [s].
            limit: Largest torque in [N m] or [N], a number or shape (n,), inf for none.

        Raises:
            InvalidInput: If a gain, the limit or dt has a wrong shape or value.
        """
        super().__init__(n)
        kp, ki, kd = gain("kp", kp, n), gain("ki", ki, n), gain("kd", kd, n)
        if np.any((kp == 0.0) & (ki > 0.0)):
            raise InvalidInput(f"kp is {kp}; allowed: positive where ki is positive")
        integral_gain = ki * positive("dt", dt)
        back_gain = np.minimum(np.divide(integral_gain, kp, out=np.zeros(n), where=kp > 0.0), 1.0)
        self.tuning = kp, kd, integral_gain, back_gain, positive_limits("limit", limit, n)
        self.restart()

    @property
    def integral(self) -> Array:
        """The integral's torque in [N m] or [N], shape (n,)."""
        return self.memory[0].copy()

    def restart(self) -> None:
        """Reset the integral."""
        self.memory = (np.zeros(self._n),)

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """Torques, and the integral with back-calculation; see ``JointLaw.formula``."""
        (kp, kd, integral_gain, back_gain, limit), (integral,) = tuning, memory
        unlimited = feedback(q, v, desired, kp, kd) + integral
        tau = clipped(unlimited, limit)
        return tau, (integral + integral_gain * (desired.q - q) + back_gain * (tau - unlimited),)


@sealed
class GravityCompensation(JointLaw):
    """Compensates gravity only, for hand guiding: τ = G(q) + S(q, 0) - D v.

    S is the torque of springs, which relieve the drives.
    """

    def __init__(self, dynamics: Dynamics | ArmModel, damping: ArrayLike = 0.0) -> None:
        """Choose the damping D in [N m s/rad] or [N s/m], a number or shape (n,)."""
        model = model_of(dynamics)
        super().__init__(model.n, model)
        self.tuning = (gain("damping", damping, model.n),)

    def torque(self, state: ArmState, reference: Any = None) -> Array:
        """Return joint torques in [N m] or [N], shape (n,); the reference is ignored."""
        q, v = checked(state, self._n)
        return np.asarray(self.formula(self._rigid, q, v, reference, self.tuning, ())[0])

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """τ = G(q) + S(q, 0) - D v; see ``JointLaw.formula``."""
        return rigid.standing(q) - tuning[0] * v, memory


@sealed
class PDGravity(PD):
    """τ = G(q) + S(q, 0) + K_p e + K_d ė: no steady-state error, for any positive gains.

    S is the torque of springs.

    Source: Takegaki and Arimoto, "A new feedback method for dynamic control of manipulators", ASME
    J. Dyn. Sys. Meas. Control 103, 1981.
    """

    def __init__(self, dynamics: Dynamics | ArmModel, kp: ArrayLike, kd: ArrayLike) -> None:
        """Choose gains, as those of ``PD``."""
        model = model_of(dynamics)
        super().__init__(model.n, kp, kd)
        self._rigid = RigidTerms(model)

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """τ = G(q) + S(q, 0) + K_p e + K_d ė; see ``JointLaw.formula``."""
        return rigid.standing(q) + feedback(q, v, desired, *tuning), memory


@sealed
class FeedForwardPD(PD):
    """Inverse dynamics of the reference, and PD: τ = ID(q_d, q̇_d, q̈_d) + K_p e + K_d ė.

    The model is evaluated at the reference: measurement noise affects the torque only through
    the gains, and the feed-forward may be computed in advance.
    """

    def __init__(self, dynamics: Dynamics | ArmModel, kp: ArrayLike, kd: ArrayLike) -> None:
        """Choose gains, as those of ``PD``."""
        model = model_of(dynamics)
        super().__init__(model.n, kp, kd)
        self._rigid = RigidTerms(model)
        self.tuning = *self.tuning, model.viscous

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """τ = ID(q_d, q̇_d, q̈_d) + K_p e + K_d ė; see ``JointLaw.formula``."""
        *gains, viscous = tuning
        feed_forward = rigid.frictionless(desired.q, desired.v, desired.a) + viscous * desired.v
        return feed_forward + feedback(q, v, desired, *gains), memory


@sealed
class JointImpedance(JointLaw):
    """The arm as springs and dampers about its path: M ë + (C + D) ė + K e = -τ_ext.

    τ = M q̈_d + C q̇_d + G + S + F_v + K e + D ė with the arm's own inertia, hence passive towards
    whatever touches it (Paden and Panja, "Globally asymptotically stable 'PD+' controller for
    robot manipulators", Int. J. Control 47(6), 1988).
    """

    def __init__(
        self, dynamics: Dynamics | ArmModel, stiffness: ArrayLike, damping_ratio: ArrayLike = 0.7,
        damping: ArrayLike | None = None,
    ) -> None:  # fmt: skip
        """Choose stiffness and damping.

        Args:
            dynamics: The model; used from one thread only.
            stiffness: K in [N m/rad] or [N/m], a number or shape (n,), not negative.
            damping_ratio: ζ of every joint alone, D = 2 ζ √(K M_ii).
            damping: D in [N m s/rad] or [N s/m] in its place, a number or shape (n,).

        Raises:
            InvalidInput: If a number has a wrong shape or value.
        """
        model = model_of(dynamics)
        super().__init__(model.n, model)
        self._has_damping_ratio = damping is None
        ratio = 2.0 * gain("damping_ratio", damping_ratio, model.n)
        resistance = ratio if damping is None else gain("damping", damping, model.n)
        self.tuning = gain("stiffness", stiffness, model.n), resistance, model.viscous

    @property
    def key(self) -> tuple[Any, ...]:
        """What the formula depends on besides the model."""
        return type(self), self._has_damping_ratio

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """τ = M q̈_d + C q̇_d + G + S + F_v + K e + D ė; see ``JointLaw.formula``."""
        (K, D, viscous), M, C = tuning, rigid.mass(q), rigid.coriolis(q, v)
        if self._has_damping_ratio:
            D = D * root(K * diagonal(M))
        feed_forward = M @ desired.a + C @ desired.v + rigid.gravity(q)
        feed_forward = feed_forward + rigid.spring(q, desired.v) + viscous * desired.v
        return feed_forward + feedback(q, v, desired, K, D), memory
