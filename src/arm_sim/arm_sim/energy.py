# SPDX-License-Identifier: Apache-2.0
"""Where the energy of a motion came from and where it went."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from arm_dynamics.model import Array


def input_work(q: Array, tau: Array) -> Array:
    """Work that held torques have done by each time.

    It is exact, since a torque is constant within its tick.

    Args:
        q: Joint positions in [rad] or [m], shape (k+1, n).
        tau: Torque of each tick in [N m] or [N], shape (k, n).

    Returns:
        Work in [J], shape (k+1,), starting at zero.
    """
    return _sum(np.sum(tau * np.diff(q, axis=0), axis=1))


def dissipated_work(time: Array, q: Array, v: Array, friction: Callable[[Array], Array]) -> Array:
    """Energy that friction has taken out by each time: the integral of F(v)·v by Simpson's rule.

    The velocity in the middle of a tick is that of the cubic through both ends (Hermite).

    Args:
        time: In [s], shape (k+1,).
        q: Joint positions in [rad] or [m], shape (k+1, n).
        v: Joint velocities in [rad/s] or [m/s], shape (k+1, n).
        friction: F(v) for velocities of shape (k, n).

    Returns:
        Energy in [J], shape (k+1,), starting at zero.
    """
    if len(time) < 2:
        return np.zeros(len(time))
    h = np.diff(time)[:, None]
    middle = 1.5 * np.diff(q, axis=0) / h - 0.25 * (v[:-1] + v[1:])
    power = [np.sum(friction(speed) * speed, axis=1) for speed in (v[:-1], middle, v[1:])]
    return _sum(h[:, 0] * (power[0] + 4.0 * power[1] + power[2]) / 6.0)


def _sum(parts: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(parts)])
