# SPDX-License-Identifier: Apache-2.0
"""Wrappers of a controller: limits, added torques, an observer, transition to another one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive, positive_limits
from arm_dynamics.attributes import sealed
from arm_dynamics.control.compiled_law import CompiledLaw, compiled_law
from arm_dynamics.control.controller import (
    Controller,
    Measured,
    Moving,
    Restartable,
    added_torques,
    checked,
    restart,
)
from arm_dynamics.control.joint_space import clipped
from arm_dynamics.control.law import LawInput, Parts, Wrapper
from arm_dynamics.control.pole_placement import gain
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.equations.elementary import choose, sign
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.reference import Reference

AnyController = Controller[Any]
"""A controller for any kind of reference."""


@sealed
class Saturated:
    """Clips torques at limits and reports it.

    Clipping a joint's torque changes the direction of the arm's acceleration: a controller that
    cancels the dynamics loses its error equation while ``saturated`` is true anywhere.

    Attributes:
        control: The controller.
    """

    def __init__(self, control: AnyController, limit: ArrayLike, n: int) -> None:
        """Set limits in [N m] or [N], positive, inf for none, a number or shape (n,)."""
        self.control, self._limit = control, positive_limits("limit", limit, n)
        self._unlimited = np.zeros(n)

    @property
    def asked(self) -> Array:
        """Last torque of the controller, before the limits, shape (n,)."""
        return self._unlimited.copy()

    @property
    def saturated(self) -> Array:
        """Joints that were clipped in the last tick, shape (n,)."""
        return np.asarray(abs(self._unlimited) > self._limit)

    def restart(self) -> None:
        """Let the controller forget the past."""
        restart(self.control)

    def compiled(self) -> CompiledLaw | None:
        """Return the controller with its limits; None if it is not compiled."""
        law = compiled_law(self.control)
        return None if law is None else replace(law, limit=self._limit)

    def torque(self, state: Moving, reference: Any) -> Array:
        """Return joint torques within the limits in [N m] or [N], shape (n,)."""
        self._unlimited = self.control.torque(state, reference)
        # A third of the time of np.clip.
        return np.asarray(np.minimum(np.maximum(self._unlimited, -self._limit), self._limit))


class WithAddedTorques(Wrapper):
    """A joint controller with the torques of the reference added."""

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        tau, added = self.control.torque(state, reference), added_torques(reference, self._n)
        return tau if added is None else np.asarray(tau + added)

    def changed(self, tau: Any, now: LawInput, tuning: Parts, memory: Parts) -> tuple[Any, Parts]:
        """The controller's torques and the reference's."""
        return tau + now.desired.tau, memory


@sealed
class DisturbanceObserver(Wrapper):
    """A controller that subtracts the disturbance estimated by a momentum observer.

    r = K (p - ∫ (τ + Cᵀ v - G - S - F + r) dt) with p = M v follows the torque that the model does
    not know (payload, friction, contact) with first-order lag 1/K, without acceleration (De Luca
    and Mattone, "Actuator failure detection and isolation using generalized momenta", ICRA 2003).
    """

    def __init__(
        self, control: AnyController, dynamics: Dynamics, dt: float, bandwidth: ArrayLike = 20.0,
        limit: ArrayLike = np.inf,
    ) -> None:  # fmt: skip
        """Choose the bandwidth.

        Args:
            control: The controller to extend.
            dynamics: The model; used from one thread only.
            dt: Time between calls in [s].
            bandwidth: K in [1/s], a number or shape (n,); K dt must stay below one.
            limit: Largest effective torque in [N m] or [N], which the observer must know.

        Raises:
            InvalidInput: If a number has a wrong shape or value.
        """
        super().__init__(control, dynamics.n, dynamics.model)
        self._friction = dynamics.steady_friction
        step, K = positive("dt", dt), gain("bandwidth", bandwidth, dynamics.n)
        if np.any(K * step >= 1.0):
            raise InvalidInput(
                f"bandwidth = {bandwidth!r} with dt = {dt}: their product must stay below one"
            )
        self._tuning = K, np.array([step]), positive_limits("limit", limit, dynamics.n)
        self.restart()

    @property
    def disturbance(self) -> Array:
        """Last estimate of the external torque in [N m] or [N], shape (n,)."""
        return self._memory[0].copy()

    def restart(self) -> None:
        """Reset the observer."""
        still = np.zeros(self._n)
        self._memory = still, still, still, np.zeros(1)
        super().restart()

    def changed(self, tau: Any, now: LawInput, tuning: Parts, memory: Parts) -> tuple[Any, Parts]:
        """Torque without the disturbance; the memory is r, τ, the integral, and 1 once it runs."""
        (rigid, q, v, _), (K, dt, limit) = now, tuning
        r, last, integral, started = memory
        momentum = rigid.mass(q) @ v
        lost = self._friction(v, sign(v), q, last)
        modelled = rigid.coriolis(q, v).T @ v - rigid.gravity(q) - rigid.spring(q, v) - lost
        integral = choose(started > 0.0, integral + dt * (last + modelled + r), momentum)
        r = K * (momentum - integral)
        tau = clipped(tau - r, limit)
        return tau, (r, tau, integral, started * 0.0 + 1.0)


@sealed
class HalfTickAhead:
    """A controller that receives the predicted state in the middle of the tick of its torque.

    Holding a torque for a tick delays it by half a tick on the average, which costs an error of
    first order in dt; predicting the state that far with the model makes it one of second order.
    Sample the reference half a tick ahead as well.
    """

    def __init__(self, control: AnyController, dynamics: Dynamics, dt: float) -> None:
        """Take a controller, the model and the time dt in [s] between calls.

        Raises:
            InvalidInput: If dt is not positive.
        """
        self._control, self._n = control, dynamics.n
        self._rigid, self._friction = RigidTerms(dynamics.model), dynamics.steady_friction
        self._half = 0.5 * positive("dt", dt)
        self._last: Array | None = None

    def restart(self) -> None:
        """Reset the last torque."""
        self._last = None
        restart(self._control)

    def torque(self, state: Moving, reference: Any) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n)
        h, a = self._half, np.zeros_like(v)
        if self._last is not None:
            lost = self._friction(v, np.sign(v), q, self._last)
            bias = self._rigid.bias(q, v) + self._rigid.spring(q, v) + lost
            a = self._rigid.mobility(q) @ (self._last - bias)
        ahead = Measured(q + h * v + 0.5 * h * h * a, v + h * a)
        self._last = self._control.torque(ahead, reference)
        return self._last.copy()


@sealed
class Switch:
    """Switches from one controller to another without a jump of the torque.

    The first torque of the new one is the last of the old one; the difference fades out smoothly.
    References may be of another kind after the switch.

    Example:
        >>> control = Switch(PDGravity(dyn, kp, kd), dt=1e-3)
        >>> tau = control.torque(state, reference)
        >>> control.to(ComputedTorque(dyn))
    """

    def __init__(self, control: AnyController, dt: float, fade: float = 0.2) -> None:
        """Start with a controller.

        Args:
            control: The first one.
            dt: Time between calls in [s].
            fade: Duration of a transition in [s], zero for one tick.

        Raises:
            InvalidInput: If a time is out of range.
        """
        if not 0.0 <= fade < np.inf:
            raise InvalidInput(f"fade is {fade}; a time of at least zero is expected")
        self._active, self._ticks = control, max(1, round(fade / positive("dt", dt)))
        self._last: Array | None = None
        self._offset: Array | None = None
        self._left = 0

    @property
    def active(self) -> AnyController:
        """The active controller."""
        return self._active

    @property
    def fading(self) -> bool:
        """Whether a transition is in progress."""
        return self._left > 0

    def to(self, control: AnyController) -> None:
        """Switch to ``control`` at the next tick; its memory is reset."""
        restart(control)
        self._active, self._offset, self._left = control, None, self._ticks

    def retune(self, control: AnyController) -> None:
        """Use the same controller with other gains: immediately, unless it has memory."""
        if isinstance(control, Restartable):
            self.to(control)
        else:
            self._active = control

    def note(self, tau: Array) -> None:
        """Set the last torque in [N m] or [N], shape (n,), if it was computed elsewhere."""
        self._last = tau

    def restart(self) -> None:
        """Reset a transition in progress, and the memory of the controller."""
        self._last, self._offset, self._left = None, None, 0
        restart(self._active)

    def torque(self, state: Moving, reference: Any) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        tau = self._active.torque(state, reference)
        if self._last is None:
            self._left = 0  # there is nothing to fade from
        elif self._left:
            if self._offset is None:
                self._offset, tau = self._last - tau, self._last
            else:
                s = self._left / self._ticks
                tau = tau + self._offset * (s * s * (3.0 - 2.0 * s))
            self._left -= 1
        self._last = tau
        return tau.copy()
