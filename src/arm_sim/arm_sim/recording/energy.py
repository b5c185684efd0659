# SPDX-License-Identifier: Apache-2.0
"""Where the energy of a motion came from and where it went, from what was recorded of it."""

from __future__ import annotations

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.model.arm import Array


def input_work(q: Array, tau: Array) -> Array:
    """Work that held torques do in each tick.

    It is exact, since a torque is constant within its tick.

    Args:
        q: Joint positions in [rad] or [m], shape (k+1, n).
        tau: Torque of each tick in [N m] or [N], shape (k, n).

    Returns:
        Work in [J], shape (k,).
    """
    work: Array = np.sum(tau * np.diff(q, axis=0), axis=1)
    return work


def dissipated_work(dynamics: Dynamics, dt: float, q: Array, v: Array, tau: Array) -> Array:
    """Energy that friction takes out in each tick: the integral of F·v by Simpson's rule.

    Position and velocity in the middle of a tick are those of the cubic through both ends
    (Hermite).

    Args:
        dynamics: The scene's dynamics.
        dt: Length of a tick in [s].
        q: Joint positions in [rad] or [m], shape (k+1, n).
        v: Joint velocities in [rad/s] or [m/s], shape (k+1, n).
        tau: Torque of each tick in [N m] or [N], shape (k, n).

    Returns:
        Energy in [J], shape (k,).
    """
    if not len(tau):
        return np.zeros(0)
    middle = 0.5 * (q[:-1] + q[1:]) + 0.125 * dt * (v[:-1] - v[1:])
    speed = 1.5 * np.diff(q, axis=0) / dt - 0.25 * (v[:-1] + v[1:])
    power = [
        np.sum(dynamics.friction(rate, q=at, load=tau) * rate, axis=1)
        for at, rate in ((q[:-1], v[:-1]), (middle, speed), (q[1:], v[1:]))
    ]
    return dt * (power[0] + 4.0 * power[1] + power[2]) / 6.0
