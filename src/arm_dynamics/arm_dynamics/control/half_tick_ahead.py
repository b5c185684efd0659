# SPDX-License-Identifier: Apache-2.0
"""Prediction of the state by half a tick, which compensates the delay of a held torque."""

from typing import Any

import numpy as np

from arm_dynamics.arrays import Array, positive
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import AnyController, ArmState, Measured, checked, restart
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.model.pinocchio_terms import RigidTerms


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
        """Let the controller forget the past; the next prediction is without acceleration."""
        self._last = None
        restart(self._control)

    def torque(self, state: ArmState, reference: Any) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n)
        h, a = self._half, np.zeros_like(v)
        if self._last is not None:
            friction = self._friction(v, np.sign(v), q, self._last)
            bias = self._rigid.bias(q, v) + self._rigid.spring(q, v) + friction
            a = self._rigid.mobility(q) @ (self._last - bias)
        prediction = Measured(q + h * v + 0.5 * h * h * a, v + h * a)
        self._last = self._control.torque(prediction, reference)
        return self._last.copy()
