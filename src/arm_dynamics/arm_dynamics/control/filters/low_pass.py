# SPDX-License-Identifier: Apache-2.0
"""Low-pass filter of sampled signals, one for each joint."""

import numpy as np

from arm_dynamics.arrays import Array


def coefficients(order: int, cutoff: float, dt: float) -> tuple[Array, Array]:
    """Butterworth filter by the bilinear transform, which meets the cut-off frequency exactly.

    With K = tan(π f dt): first order H(s) = 1 / (s + 1), second order H(s) = 1 / (s² + √2 s + 1),
    s = (1 - z⁻¹) / (K (1 + z⁻¹)) (Oppenheim and Schafer, "Discrete-Time Signal Processing", 7.1).

    Args:
        order: 1 or 2.
        cutoff: f in [Hz], where the gain is 1/√2; below half the sampling rate.
        dt: Sampling interval in [s].

    Returns:
        b and a of H(z) = (b0 + b1 z⁻¹ + b2 z⁻²) / (1 + a1 z⁻¹ + a2 z⁻²), shape (3,) each.
    """
    K = np.tan(np.pi * cutoff * dt)
    if order == 1:
        b, a = np.array([K, K, 0.0]), np.array([K + 1.0, K - 1.0, 0.0])
    else:
        r = np.sqrt(2.0) * K
        b = K * K * np.array([1.0, 2.0, 1.0])
        a = np.array([1.0 + r + K * K, 2.0 * (K * K - 1.0), 1.0 - r + K * K])
    return b / a[0], a / a[0]


class LowPass:
    """Filters that run side by side, in transposed direct form II.

    Args:
        order: 1 or 2.
        cutoff: For each of n signals in [Hz]; 0: no filter.
        dt: Sampling interval in [s].
    """

    def __init__(self, order: int, cutoff: list[float], dt: float) -> None:
        n = len(cutoff)
        passing = np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
        filters = [coefficients(order, f, dt) if f else passing for f in cutoff]
        self._b, self._a = np.array([b for b, _ in filters]), np.array([a for _, a in filters])
        # y = b0 x + s1, s1' = (b1 - a1 b0) x - a1 s1 + s2, s2' = (b2 - a2 b0) x - a2 s1
        step = np.zeros((order + 1, order + 1, n))
        step[0, 0], step[0, 1] = self._b[:, 0], 1.0
        for k in range(1, order + 1):
            step[k, 0] = self._b[:, k] - self._a[:, k] * self._b[:, 0]
            step[k, 1] = -self._a[:, k]
        if order == 2:
            step[1, 2] = 1.0
        self._step, self._w = step, np.zeros((order + 1, n))
        self._next, self._product = np.zeros((order + 1, n)), np.zeros(step.shape)

    def settle(self, x: Array) -> None:
        """Start as if the signal had always been ``x``, shape (n,)."""
        b, a = self._b, self._a
        if len(self._w) == 3:
            self._w[2] = (b[:, 2] - a[:, 2]) * x
            self._w[1] = (b[:, 1] - a[:, 1]) * x + self._w[2]
        else:
            self._w[1] = (b[:, 1] - a[:, 1]) * x

    def filtered(self, x: Array) -> Array:
        """The next output for the next input, shape (n,) both; valid until the next call."""
        self._w[0] = x
        np.multiply(self._step, self._w, self._product)
        self._product.sum(axis=1, out=self._next)
        self._w[1:] = self._next[1:]
        return np.asarray(self._next[0])
