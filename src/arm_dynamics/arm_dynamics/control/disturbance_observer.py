# SPDX-License-Identifier: Apache-2.0
"""Compensation of torques that the model does not know, by a momentum observer."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive, positive_limits
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import AnyController
from arm_dynamics.control.law import LawInput, Parts, Wrapper
from arm_dynamics.control.pole_placement import gain
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.equations.elementary import choose, clipped, sign
from arm_dynamics.exceptions import InvalidInput


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

    def adapt(self, tau: Any, inputs: LawInput, tuning: Parts, memory: Parts) -> tuple[Any, Parts]:
        """Torque without the disturbance; the memory is r, τ, the integral, and 1 once it runs."""
        (rigid, q, v, _), (K, dt, limit) = inputs, tuning
        r, last, integral, started = memory
        momentum = rigid.mass(q) @ v
        friction = self._friction(v, sign(v), q, last)
        modelled = rigid.coriolis(q, v).T @ v - rigid.gravity(q) - rigid.spring(q, v) - friction
        integral = choose(started > 0.0, integral + dt * (last + modelled + r), momentum)
        r = K * (momentum - integral)
        tau = clipped(tau - r, limit)
        return tau, (r, tau, integral, started * 0.0 + 1.0)
