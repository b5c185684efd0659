# SPDX-License-Identifier: Apache-2.0
"""Joint controllers: small classes with one interface, ``torque(state, reference) -> τ``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, all_finite, numbers, vector
from arm_dynamics.attributes import sealed
from arm_dynamics.dynamics.dynamics import Dynamics, model_of
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.rigid_expressions import RigidExpressions
from arm_dynamics.trajectory.reference import Reference

Parts = Sequence[Any]
"""Numbers of a formula, arrays or expressions."""
_FLOAT = np.dtype(float)
_NONE = object()  # without a reference
_FASTEST = 1e6  # [rad/s], beyond anything that a torque can follow


class Moving(Protocol):
    """Anything with joint positions ``q`` in [rad] and velocities ``v`` in [rad/s], shape (n,)."""

    @property
    def q(self) -> Array:
        """Joint positions."""

    @property
    def v(self) -> Array:
        """Joint velocities."""


@sealed
@dataclass(frozen=True, slots=True)
class Measured:
    """Joint positions and velocities as measured.

    Attributes:
        q: Positions in [rad] or [m], shape (n,).
        v: Velocities in [rad/s] or [m/s], shape (n,).
    """

    q: Array
    v: Array


class Checked(Measured):
    """A state whose shapes and finiteness have been checked."""

    __slots__ = ()


class Controller[Goal](Protocol):
    """Computes the torque that moves an arm to its reference, of joints or of a frame.

    A class of your own must have this one method. It may derive from this protocol, but need not;
    its method ``restart()``, if any, is called when time jumps, or when it takes over from
    another controller. Its constructor names the arguments that it needs (``dynamics``, ``dt``,
    …), see ``make_controller``.
    """

    def torque(self, state: Moving, reference: Goal) -> Array:
        """Return joint torques in [N m] or [N], finite, shape (n,), constant until the next call.

        Args:
            state: Joint positions ``q`` and velocities ``v``, each of shape (n,), read-only.
            reference: Desired joint motion: ``q``, ``v`` and ``a``, each of shape (n,), of a
                ``trajectory.Reference``. Its ``tau`` is added by ``make_controller``.
        """


@runtime_checkable
class Restartable(Protocol):
    """A controller with memory."""

    def restart(self) -> None:
        """Reset the memory."""


def restart(control: object) -> None:
    """Reset the memory of a controller, if it has one."""
    if isinstance(control, Restartable):
        control.restart()


@sealed
class ComputedTorque:
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

    key = ("computed torque",)
    memory: tuple[Array, ...] = ()

    def __init__(
        self,
        dynamics: Dynamics,
        bandwidth: ArrayLike = 20.0,
        damping_ratio: ArrayLike = 1.0,
        dt: float = 1e-3,
    ) -> None:
        """Choose gains.

        Args:
            dynamics: The model; used from one thread only.
            bandwidth: ω in [rad/s], a number or shape (n,), not negative.
            damping_ratio: ζ, a number or shape (n,), not negative; 1 is critically damped.
            dt: Time in [s] for which a torque is held, 0 for none.

        Raises:
            InvalidInput: If a gain or dt has a wrong shape or value.
        """
        self._model = model_of(dynamics)
        self._n, self._friction = dynamics.n, dynamics.steady_friction
        self._rigid = RigidTerms(dynamics.model)
        gains = held_gains(bandwidth, damping_ratio, dynamics.n, dt)
        self.tuning = *gains, np.array([float(dt)])

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m], shape (n,).

        Args:
            state: Measured positions and velocities.
            reference: Desired motion.
        """
        q, v = checked(state, self._n, reference)
        friction, desired = self._friction, (reference.q, reference.v, reference.a)
        sliding = np.sign(np.where(v == 0.0, reference.v, v)) if friction.has_dry else v
        rigid, tuning = self._rigid.frictionless, self.tuning
        return np.asarray(demanded_torque(rigid, friction, q, v, desired, tuning, sliding))

    def formula(
        self, rigid: Any, q: ca.SX, v: ca.SX, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[ca.SX, Parts]:
        """Torques as an expression; see ``compiled_law.Law``."""
        motion = desired.q, desired.v, desired.a
        return expression(self._model, q, v, motion, tuning), memory


def demanded_torque(
    inverse: Callable[[Any, Any, Any], Any], friction: SteadyFriction, q: Any, v: Any,
    desired: Sequence[Any], tuning: Sequence[Any], sliding: Any,
) -> Any:  # fmt: skip
    """Torque for the acceleration q̈_d + K_d ė + K_p e in the middle of a tick.

    Args:
        inverse: M a + C v + G + S of positions, velocities and accelerations.
        friction: Friction that is added to it.
        q: Joint positions in [rad] or [m], an array or expression of shape (n,).
        v: Joint velocities, likewise.
        desired: Position, velocity and acceleration of the reference, likewise.
        tuning: K_p and K_d of shape (n,), and the time dt for which a torque is held.
        sliding: Direction in which joints slide, -1 to 1, shape (n,).

    Returns:
        Joint torques in [N m] or [N], shape (n,).
    """
    (q_d, v_d, a_d), (kp, kd, dt) = desired, tuning
    a = a_d + kd * (v_d - v) + kp * (q_d - q)
    middle, speed = q + 0.5 * dt * v, v + 0.5 * dt * a
    return friction.demanded(inverse(middle, speed, a), speed, sliding, middle)


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
    if np.any(omega > _FASTEST):
        raise InvalidInput(f"bandwidth is {bandwidth!r}; allowed: at most {_FASTEST:g} rad/s")
    return omega**2, 2.0 * gain("damping_ratio", damping_ratio, n) * omega


def held_gains(
    bandwidth: ArrayLike, damping_ratio: ArrayLike, n: int, dt: float
) -> tuple[Array, Array]:
    """Gains of an acceleration that is held for dt: the error is to fall as with ``gains``.

    Held, u = -K_p e - K_d ė takes ë = u from tick to tick by a matrix whose eigenvalues are made
    those of the continuous equation, z = exp(λ dt) with λ² + 2 ζ ω λ + ω² = 0 (Åström and
    Wittenmark, Computer-Controlled Systems, 1997, section 4.3):

        K_p = (1 - z₁)(1 - z₂)/dt²,  K_d = (3 - z₁ - z₂ - z₁ z₂)/(2 dt).

    So the loop is stable for any bandwidth; for dt → 0 these are ω² and 2 ζ ω.

    Args, returns and errors as those of ``gains``, and ``dt``: time in [s] for which an
    acceleration is held, not negative.
    """
    kp, kd = gains(bandwidth, damping_ratio, n)
    if not 0.0 <= dt < np.inf:
        raise InvalidInput(f"dt is {dt}; a time of at least zero is expected")
    if dt == 0.0:
        return kp, kd
    root = np.sqrt((0.25 * kd**2 - kp).astype(complex))
    first, second = -np.expm1((root - 0.5 * kd) * dt), -np.expm1(-(root + 0.5 * kd) * dt)
    both = -np.expm1(-kd * dt)
    return (first * second).real / dt**2, ((first + second).real + both) / (2.0 * dt)


def gain(name: str, value: ArrayLike, n: int) -> Array:
    """Check a gain of every joint.

    Args:
        name: Name of the gain, for messages.
        value: A number or shape (n,), not negative.
        n: Number of joints.

    Returns:
        The gain of shape (n,).

    Raises:
        InvalidInput: If it has a wrong shape or value.
    """
    given = numbers(name, value)
    if given.shape not in ((), (1,), (n,)):
        raise InvalidInput(f"{name} has shape {given.shape}; allowed: a number or shape ({n},)")
    if np.any(given < 0.0):
        raise InvalidInput(f"{name} is {given}; allowed: numbers of at least 0")
    return np.array(np.broadcast_to(given, (n,)))


def checked(state: Moving, n: int, reference: object = _NONE) -> tuple[Array, Array]:
    """Positions and velocities of a state, each of shape (n,) and finite.

    Args:
        state: State of the arm. A ``Checked`` one, with a valid reference, is not checked again.
        n: Number of joints.
        reference: The reference, if its shapes must be checked as well.

    Raises:
        InvalidInput: If they are anything else.
    """
    q, v = state.q, state.v
    if type(state) is Checked:
        return q, v
    if reference is not _NONE:
        _check_shapes(reference, n)
    arrays = isinstance(q, np.ndarray) and isinstance(v, np.ndarray)
    if arrays and q.shape == v.shape == (n,) and q.dtype == v.dtype == _FLOAT:
        if all_finite(q) and all_finite(v):
            return q, v
    for name, value in (("state.q", q), ("state.v", v)):
        if vector(name, value, n).ndim != 1:
            raise InvalidInput(f"{name} has shape {np.shape(value)}; ({n},) is expected")
    return np.asarray(q, float), np.asarray(v, float)


def added_torques(reference: object, n: int) -> Array | None:
    """Torques of a reference to add to a controller's, shape (n,); None for none.

    Raises:
        InvalidInput: If they have another shape, or are not finite.
    """
    tau = getattr(reference, "tau", None)
    return None if tau is None else vector("reference.tau", tau, n)


def _check_shapes(reference: object, n: int) -> None:
    for name in ("q", "v", "a"):
        value = getattr(reference, name, None)
        if value is None:
            raise InvalidInput(
                f"the reference is of type {type(reference).__name__}; positions q, velocities v "
                "and accelerations a are expected, as Reference(q, v, a) has them"
            )
        if np.shape(value) != (n,):
            raise InvalidInput(f"reference.{name} has shape {np.shape(value)}; ({n},) is expected")


def expression(
    model: ArmModel, q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], tuning: Sequence[ca.SX]
) -> ca.SX:
    """The controller of a model as an expression; arguments as of ``demanded_torque``."""
    rigid = RigidExpressions(model).frictionless
    sliding = ca.sign(ca.if_else(v == 0, desired[1], v))  # as in ComputedTorque
    friction = SteadyFriction.of(model)
    made: ca.SX = demanded_torque(rigid, friction, q, v, desired, tuning, sliding)
    return made
