# SPDX-License-Identifier: Apache-2.0
"""Joint controllers: small classes with one interface, ``torque(state, reference) -> τ``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.dynamics import Dynamics, Term
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.motion import Reference, numbers

Array = NDArray[np.float64]
RIGID_BODY = Term.INERTIA | Term.CORIOLIS | Term.GRAVITY


class Moving(Protocol):
    """Anything with joint positions ``q`` in [rad] and velocities ``v`` in [rad/s], shape (n,)."""

    @property
    def q(self) -> Array:
        """Joint positions."""

    @property
    def v(self) -> Array:
        """Joint velocities."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Joint positions and velocities as measured.

    Attributes:
        q: Positions in [rad] or [m], shape (n,).
        v: Velocities in [rad/s] or [m/s], shape (n,).
    """

    q: Array
    v: Array


class Controller(Protocol):
    """Answers what torque leads a moving arm to its reference."""

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m], shape (n,)."""


class ComputedTorque:
    """Computed torque: τ = ID(q, q̇, q̈_d + K_d ė + K_p e), with e = q_d − q.

    Dry friction of a joint at rest is compensated in the direction of the reference: the joint's
    own motion would say nothing and leave it stuck.

    With an exact model every joint's error obeys ë + 2 ζ ω ė + ω² e = 0 (Craig, Introduction to
    Robotics, section 10.4), so K_p = ω² and K_d = 2 ζ ω. It is not for actuators that saturate and
    does nothing about model errors but feedback.
    """

    def __init__(
        self, dynamics: Dynamics, bandwidth: ArrayLike = 20.0, damping_ratio: ArrayLike = 1.0
    ) -> None:
        """Choose gains.

        Args:
            dynamics: The model; used from one thread only.
            bandwidth: ω in [rad/s], a number or shape (n,), not negative.
            damping_ratio: ζ, a number or shape (n,), not negative; 1 is critically damped.

        Raises:
            InvalidInput: If a gain has a wrong shape or value.
        """
        self._dynamics = dynamics
        self._kp, self._kd = gains(bandwidth, damping_ratio, dynamics.n)

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m], shape (n,).

        Args:
            state: Where the arm is and how it moves.
            reference: Where it should be and how it should move.
        """
        desired = (reference.q, reference.v, reference.a)
        a = demanded_acceleration(state.q, state.v, desired, self._kp, self._kd)
        tau = self._dynamics.inverse(state.q, state.v, a, RIGID_BODY)
        sliding = np.where(state.v == 0.0, reference.v, state.v)
        law = self._dynamics.model.friction
        torque: Array = law.demanded(tau, np.asarray(state.v), np.sign(sliding), state.q)
        return torque


def demanded_acceleration(q: Any, v: Any, desired: Sequence[Any], kp: Any, kd: Any) -> Any:
    """Acceleration that leads to a reference, q̈_d + K_d ė + K_p e; for numpy and CasADi alike.

    Args:
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        desired: Position, velocity and acceleration of the reference, each of shape (n,).
        kp: K_p in [1/s²], shape (n,).
        kd: K_d in [1/s], shape (n,).

    Returns:
        Joint accelerations, shape (n,).
    """
    q_d, v_d, a_d = desired
    return a_d + kd * (v_d - v) + kp * (q_d - q)


def gains(bandwidth: ArrayLike, damping_ratio: ArrayLike, n: int) -> tuple[Array, Array]:
    """K_p = ω² and K_d = 2 ζ ω of every joint.

    Args:
        bandwidth: ω in [rad/s], a number or shape (n,), not negative.
        damping_ratio: ζ, a number or shape (n,), not negative.
        n: Number of joints.

    Returns:
        K_p in [1/s²] and K_d in [1/s], each of shape (n,).

    Raises:
        InvalidInput: If a gain has a wrong shape or value.
    """
    omega = gain("bandwidth", bandwidth, n)
    return omega**2, 2.0 * gain("damping_ratio", damping_ratio, n) * omega


def gain(name: str, value: ArrayLike, n: int) -> Array:
    """Check a gain of every joint.

    Args:
        name: What it is called, for messages.
        value: A number or shape (n,), not negative.
        n: Number of joints.

    Returns:
        The gain of shape (n,).

    Raises:
        InvalidInput: If it has a wrong shape or value.
    """
    given = numbers(name, value)
    if given.shape not in ((), (1,), (n,)):
        raise InvalidInput(f"{name} has shape {given.shape}; allowed is a number or shape ({n},)")
    if np.any(given < 0.0):
        raise InvalidInput(f"{name} is {given}; allowed are numbers that are not negative")
    return np.array(np.broadcast_to(given, (n,)))
