# SPDX-License-Identifier: Apache-2.0
"""Wrappers of a controller: limits, added torques, prediction by half a tick."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive, positive_limits
from arm_dynamics.attributes import sealed
from arm_dynamics.control.compiled_law import CompiledLaw, compiled_law
from arm_dynamics.control.controller import (
    AnyController,
    Measured,
    Moving,
    added_torques,
    checked,
    restart,
)
from arm_dynamics.control.law import LawInput, Parts, Wrapper
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.reference import Reference


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
        if (law := compiled_law(self.control)) is None:
            return None
        inner = np.inf if law.limit is None else law.limit
        return replace(law, limit=np.minimum(self._limit, inner))

    def torque(self, state: Moving, reference: Any) -> Array:
        """Return joint torques within the limits in [N m] or [N], shape (n,)."""
        self._unlimited = self.control.torque(state, reference)
        # ``clipped`` in less time, a third of that of np.clip.
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
class HalfTickAhead:
    """A controller that receives the predicted state in the middle of the tick of its torque.

    Holding a torque for a tick delays it by half a tick on the average, which costs an error of
    first order in dt; predicting the state that far with the model makes it one of second order.
    Sample the reference half a tick ahead as well. Limits belong inside it: the last
    torque of ``control`` is taken for the one that acts.
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
            friction = self._friction(v, np.sign(v), q, self._last)
            bias = self._rigid.bias(q, v) + self._rigid.spring(q, v) + friction
            a = self._rigid.mobility(q) @ (self._last - bias)
        ahead = Measured(q + h * v + 0.5 * h * h * a, v + h * a)
        self._last = self._control.torque(ahead, reference)
        return self._last.copy()
