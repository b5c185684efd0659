# SPDX-License-Identifier: Apache-2.0
"""Piecewise quintic trajectories of joints."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, numbers, real_array
from arm_dynamics.attributes import frozen
from arm_dynamics.trajectory.quintics import knot_derivatives, segment_coefficients
from arm_dynamics.trajectory.reference import Reference
from arm_dynamics.trajectory.trajectory_library import library


@frozen
class Trajectory:
    """Quintic segments, at rest before the first and after the last.

    Attributes:
        times: Knot times in [s] from 0, shape (w,).
        coefficients: Polynomials of every segment in s = (t − tᵢ)/hᵢ, shape (w − 1, n, 6).
        ends: Positions of the first and the last knot, shape (2, n).
        stretch: Factor by which it is slower than requested because of limits; 1 if it is not.
        polynomials: Coefficients of s⁰ to s⁵ of position, velocity and acceleration in every
            segment, shape (w − 1, 6, 3, n).
        torques: Torques in [N m] or [N] to add to a controller's at every knot, linear between
            them and constant before and after, shape (w, n); None for none.
    """

    times: Array
    coefficients: Array
    ends: Array
    stretch: float = 1.0
    torques: Array | None = None
    polynomials: Array = field(init=False, repr=False, compare=False)

    @classmethod
    def through(
        cls, times: Array, q: Array, v: Array, a: Array, stretch: float = 1.0
    ) -> Trajectory:
        """A trajectory through knots; free derivatives minimize ∫ jerk² dt.

        Args:
            times: Knot times in [s] from 0, shape (w,).
            q: Positions, shape (w, n).
            v: Velocities, NaN in the rows that are open, likewise; first and last are given.
            a: Accelerations, likewise.
            stretch: The trajectory's, see there.
        """
        h = np.diff(times)
        v, a = knot_derivatives(h, q, v, a)
        return cls(times, segment_coefficients(h, q, v, a), q[[0, -1]], stretch)

    def __post_init__(self) -> None:
        """Tabulate the derivatives of every segment."""
        h = np.diff(self.times)[:, None, None]
        c, k = self.coefficients, np.arange(6.0)
        stacked = np.zeros((len(c), 3, *c.shape[1:]))
        stacked[:, 0] = c
        stacked[:, 1, :, :5] = (c * k)[..., 1:] / h
        stacked[:, 2, :, :4] = (c * k * (k - 1))[..., 2:] / h**2
        object.__setattr__(self, "polynomials", np.moveaxis(stacked, 3, 1))
        for name in ("times", "coefficients", "ends", "polynomials", "torques"):
            if getattr(self, name) is None:
                continue
            array = np.ascontiguousarray(getattr(self, name), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def duration(self) -> float:
        """Time from the first to the last knot in [s]."""
        return float(self.times[-1])

    def sample(self, t: float) -> Reference:
        """Evaluate the trajectory.

        Args:
            t: Time from the start in [s]; before 0 and after the duration it is at rest.

        Returns:
            Position, velocity, acceleration and torques; read-only arrays of shape (n,).
        """
        n = self.ends.shape[1]
        motion = np.empty((4, n))
        if (code := library()) is None:
            motion[:3] = self.at(np.array([t], float))[:, 0]
            motion[3] = self._torques_at(t)
        else:
            arrays = self.times, self.polynomials, self.ends, self.torques
            addresses = (None if x is None else x.ctypes.data for x in arrays)
            code.trajectory_sample(n, len(self.times) - 1, *addresses, t, motion.ctypes.data)
        motion.setflags(write=False)
        q, v, a, tau = motion
        return Reference(q, v, a, None if self.torques is None else tau)

    def _torques_at(self, t: float) -> Any:
        """Torques at a time in [s], as ``sample.c`` computes them."""
        if self.torques is None:
            return 0.0
        if not 0.0 <= t < self.times[-1]:
            return self.torques[0 if t < 0.0 else -1]
        i = int(np.searchsorted(self.times, t, "right")) - 1
        before, after = self.torques[i : i + 2]
        s = (t - self.times[i]) / (self.times[i + 1] - self.times[i])
        return before + s * (after - before)

    def at(self, times: Array) -> Array:
        """Positions, velocities and accelerations at times in [s], shape (3, k, n)."""
        times = real_array("times", times)
        is_inside = (times >= 0.0) & (times < self.times[-1])
        i = np.searchsorted(self.times, times[is_inside], "right") - 1
        s = ((times[is_inside] - self.times[i]) / np.diff(self.times)[i])[:, None, None]
        motion = np.zeros((len(times), 3, self.ends.shape[1]))
        motion[is_inside] = _evaluate(np.moveaxis(self.polynomials[i], 1, 0), s)
        motion[~is_inside, 0] = self.ends[(times[~is_inside] >= self.times[-1]).astype(int)]
        return np.moveaxis(motion, 1, 0)

    def at_shares(self, shares: Array) -> Array:
        """Positions, velocities and accelerations within each segment, both ends included.

        Args:
            shares: Fractions τ of every segment's duration, in [0, 1], shape (m,).

        Returns:
            Shape (segments, 3, n, m).
        """
        powers = np.power.outer(shares, np.arange(6.0)).T
        return np.asarray(np.moveaxis(self.polynomials, 1, 3) @ powers)

    def table(self, shares: Array) -> tuple[Array, Array, Array, Array]:
        """Times, shape (k,), and positions, velocities and accelerations there, (k, n) each."""
        times = (self.times[:-1, None] + np.diff(self.times)[:, None] * shares).ravel()
        rows = np.moveaxis(self.at_shares(shares), 3, 1)
        q, v, a = np.moveaxis(rows.reshape(len(times), 3, -1), 1, 0)
        return times, q, v, a


def _evaluate(polynomials: Array, s: Array) -> Array:
    """Polynomials of shape (6, …) at s, by Horner's rule.

    Every product and every sum is rounded, so every processor gives the same bits, and so does
    compiled code (``sample.c``). A matrix product would not.
    """
    value: Array = polynomials[5] * s + polynomials[4]
    for coefficients in polynomials[3::-1]:
        value *= s
        value += coefficients
    return value


def hold(q: ArrayLike, tau: ArrayLike | None = None) -> Trajectory:
    """Hold position ``q`` forever, and add torques ``tau`` to a controller's; each (n,)."""
    ends = np.stack([numbers("position", q)] * 2)
    torques = None if tau is None else numbers("torques", tau)[None]
    return Trajectory(np.zeros(1), np.empty((0, ends.shape[1], 6)), ends, torques=torques)
