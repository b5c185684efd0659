# SPDX-License-Identifier: Apache-2.0
"""Controllers in joint space; see ``computed_torque`` for the common interface."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive, positive_limits, vector
from arm_dynamics.control.computed_torque import Moving, checked, gain, gains
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.sampling import postures
from arm_dynamics.trajectory.reference import Reference

_POSTURES = 200  # over which inertia is averaged
_STABLE = 1.5  # of dt times the greatest eigenvalue of M⁻¹ K_d; from 2 on a held torque swings up


class PD:
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
        self._n, self._kp, self._kd = n, gain("kp", kp, n), gain("kd", kd, n)

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        return self._feedback(*checked(state, self._n, reference), reference)

    def _feedback(self, q: Array, v: Array, reference: Reference) -> Array:
        return self._kp * (reference.q - q) + self._kd * (reference.v - v)


class PID:
    """τ = K_p e + K_d ė + ∫ K_i e dt, clipped at the limits, with anti-windup.

    If a torque is clipped, the integral is reduced by the excess with the time constant K_p / K_i
    (back-calculation; Åström and Hägglund, Advanced PID Control, 2006, section 3.5).
    """

    def __init__(
        self,
        n: int,
        kp: ArrayLike,
        ki: ArrayLike,
        kd: ArrayLike,
        dt: float,
        limit: ArrayLike = np.inf,
    ) -> None:
        """Choose gains.

        Args:
            n: Degrees of freedom.
            kp: K_p in [N m/rad] or [N/m], a number or shape (n,), positive.
            ki: K_i in [N m/(rad s)] or [N/(m s)], likewise, not negative.
            kd: K_d in [N m s/rad] or [N s/m], likewise, not negative.
            dt: Time between calls in [s].
            limit: Largest torque in [N m] or [N], a number or shape (n,), inf for none.

        Raises:
            InvalidInput: If a gain, the limit or dt has a wrong shape or value.
        """
        self._n, self._dt = n, positive("dt", dt)
        self._kp, self._ki, self._kd = gain("kp", kp, n), gain("ki", ki, n), gain("kd", kd, n)
        if np.any((self._kp == 0.0) & (self._ki > 0.0)):
            raise InvalidInput(f"kp is {self._kp}; allowed: positive where ki is positive")
        self._limit = positive_limits("limit", limit, n)
        self._return = np.divide(self._ki, self._kp, out=np.zeros(n), where=self._kp > 0.0)
        self._integral = np.zeros(n)

    @property
    def integral(self) -> Array:
        """The integral's torque in [N m] or [N], shape (n,)."""
        return self._integral.copy()

    def restart(self) -> None:
        """Reset the integral."""
        self._integral = np.zeros(self._n)

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n, reference)
        e = reference.q - q
        asked = self._kp * e + self._kd * (reference.v - v) + self._integral
        tau = cut(asked, self._limit)
        back = np.minimum(self._return * self._dt, 1.0)
        self._integral = self._integral + self._ki * self._dt * e + back * (tau - asked)
        return tau


class GravityCompensation:
    """Compensates gravity only, for hand guiding: τ = G(q) + S(q, 0) - D v.

    S is the torque of springs, which relieve the drives.
    """

    def __init__(self, dynamics: Dynamics, damping: ArrayLike = 0.0) -> None:
        """Choose the damping D in [N m s/rad] or [N s/m], a number or shape (n,)."""
        self._rigid, self._n = RigidTerms(dynamics.model), dynamics.n
        self._damping = gain("damping", damping, dynamics.n)

    def torque(self, state: Moving, reference: object = None) -> Array:
        """Return joint torques in [N m] or [N], shape (n,); the reference is not looked at."""
        q, v = checked(state, self._n)
        return self._rigid.standing(q) - self._damping * v


class PDGravity(PD):
    """τ = G(q) + S(q, 0) + K_p e + K_d ė: no steady-state error, for any positive gains.

    S is the torque of springs.

    Source: Takegaki and Arimoto, "A new feedback method for dynamic control of manipulators", ASME
    J. Dyn. Sys. Meas. Control 103, 1981.
    """

    def __init__(self, dynamics: Dynamics, kp: ArrayLike, kd: ArrayLike) -> None:
        """Choose gains, as those of ``PD``."""
        super().__init__(dynamics.n, kp, kd)
        self._rigid = RigidTerms(dynamics.model)

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n, reference)
        return self._rigid.standing(q) + self._feedback(q, v, reference)


class FeedForwardPD(PD):
    """Inverse dynamics of the reference, and PD: τ = ID(q_d, q̇_d, q̈_d) + K_p e + K_d ė.

    The model is evaluated at the reference: measurement noise affects the torque only through
    the gains, and the feed-forward may be computed in advance.
    """

    def __init__(self, dynamics: Dynamics, kp: ArrayLike, kd: ArrayLike) -> None:
        """Choose gains, as those of ``PD``."""
        super().__init__(dynamics.n, kp, kd)
        self._rigid, self._viscous = RigidTerms(dynamics.model), dynamics.model.viscous

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n, reference)
        ahead = self._rigid.frictionless(reference.q, reference.v, reference.a)
        return ahead + self._viscous * reference.v + self._feedback(q, v, reference)


class JointImpedance:
    """The arm as springs and dampers about its path: M ë + (C + D) ė + K e = -τ_ext.

    τ = M q̈_d + C q̇_d + G + S + F_v + K e + D ė with the arm's own inertia, hence passive towards
    whatever touches it (Paden and Panja, "Globally asymptotically stable 'PD+' controller for
    robot manipulators", Int. J. Control 47(6), 1988).
    """

    def __init__(
        self,
        dynamics: Dynamics,
        stiffness: ArrayLike,
        damping_ratio: ArrayLike = 0.7,
        damping: ArrayLike | None = None,
    ) -> None:
        """Choose stiffness and damping.

        Args:
            dynamics: The model; used from one thread only.
            stiffness: K in [N m/rad] or [N/m], a number or shape (n,), not negative.
            damping_ratio: ζ of every joint alone, D = 2 ζ √(K M_ii).
            damping: D in [N m s/rad] or [N s/m] in its place, a number or shape (n,).

        Raises:
            InvalidInput: If a number has a wrong shape or value.
        """
        self._rigid, self._n = RigidTerms(dynamics.model), dynamics.n
        self._viscous = dynamics.model.viscous
        self._stiffness = gain("stiffness", stiffness, dynamics.n)
        self._ratio = 2.0 * gain("damping_ratio", damping_ratio, dynamics.n)
        self._damping = None if damping is None else gain("damping", damping, dynamics.n)

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n, reference)
        rigid, K, D = self._rigid, self._stiffness, self._damping
        M, C = rigid.mass(q), rigid.coriolis(q, v)
        if D is None:
            D = self._ratio * np.sqrt(K * M.diagonal())
        ahead = M @ reference.a + C @ reference.v + rigid.gravity(q)
        ahead += rigid.spring(q, reference.v) + self._viscous * reference.v
        return ahead + K * (reference.q - q) + D * (reference.v - v)


def tuned(
    dynamics: Dynamics,
    bandwidth: ArrayLike,
    damping_ratio: ArrayLike = 1.0,
    q: ArrayLike | None = None,
    dt: float = 1e-3,
) -> tuple[Array, Array]:
    """Gains in units of torque: K_p = ω² m and K_d = 2 ζ ω m, less viscous friction.

    The inertia m of a joint is M_ii averaged over postures: that of one posture may be next to
    nothing, and its gains too weak for the weight elsewhere. Where joints are nearly aligned, the
    arm is much lighter against some motions than M_ii says. So all gains are lowered together
    until a torque that is held for dt cannot make it swing up in any of these postures: dt times
    the greatest eigenvalue of M⁻¹ K_d is 1.5 at most; from 2 on it would.

    Args:
        dynamics: The model.
        bandwidth: ω in [rad/s], a number or shape (n,).
        damping_ratio: ζ, likewise.
        q: A posture of shape (n,) whose M_ii is to be m as it is; None for the above.
        dt: Time in [s] for which a torque is held.

    Returns:
        K_p in [N m/rad] or [N/m] and K_d in [N m s/rad] or [N s/m], each of shape (n,).

    Raises:
        InvalidInput: If a number has a wrong shape or value.
    """
    kp, kd = gains(bandwidth, damping_ratio, dynamics.n)
    if q is None:
        inertia = _typical_inertia(dynamics, kd * positive("dt", dt))
    else:
        inertia = dynamics.mass_matrix(vector("q", q, dynamics.n)).diagonal()
    return kp * inertia, np.maximum(kd * inertia - dynamics.model.viscous, 0.0)


def _typical_inertia(dynamics: Dynamics, damping: Array) -> Array:
    """The inertia m of ``tuned`` for K_d dt = damping m, shape (n,)."""
    M = dynamics.mass_matrix(postures(dynamics.model, _POSTURES))
    m = np.asarray(M.diagonal(0, 1, 2).mean(0))
    root = np.sqrt(damping * m)
    scaled = root[:, None] * np.linalg.inv(M) * root
    greatest = float(np.linalg.eigvalsh(scaled).max())
    return m * min(1.0, _STABLE / greatest) if greatest > 0.0 else m


def cut(tau: Array, limit: Array) -> Array:
    """Torques within ± limit, shape (n,); a third of the time of ``np.clip``."""
    return np.asarray(np.minimum(np.maximum(tau, -limit), limit))
