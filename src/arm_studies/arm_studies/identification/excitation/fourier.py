# SPDX-License-Identifier: Apache-2.0
"""Fourier series that begin and end at rest at a given position.

Exciting motions are finite Fourier series since Swevers, Ganseman, Tükel, De Schutter, Van
Brussel, "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 13(5),
1997: periodic, so that periods can be averaged, and of known bandwidth. Among the series with N
harmonics we use those with the start position, zero velocity and zero acceleration at t = 0:
three linear conditions per joint, which the functions

    S_l(t) = sin(l ω t)/l - sin(ω t),   C_l(t) = (1 - cos(l ω t))/l² - (1 - cos(ω t)),   l = 2 … N

all satisfy. So the arm starts from rest and returns to it within the series itself, and periods
join smoothly.
"""

import numpy as np

from arm_dynamics.arrays import Array


def basis(times: Array, period: float, harmonics: int) -> Array:
    """The functions S_l and C_l and their first and second derivatives.

    Args:
        times: In [s], shape (k,).
        period: Of the lowest harmonic in [s].
        harmonics: N, at least 2.

    Returns:
        Shape (3, 2 (N - 1), k): a motion is start + coefficients @ basis[0], and so on.
    """
    omega = 2.0 * np.pi / period
    angle = omega * times
    order = np.arange(2, harmonics + 1)[:, None]
    s, c, s1, c1 = np.sin(order * angle), np.cos(order * angle), np.sin(angle), np.cos(angle)
    position = np.vstack([s / order - s1, (1.0 - c) / order**2 - (1.0 - c1)])
    velocity = omega * np.vstack([c - c1, s / order - s1])
    acceleration = omega**2 * np.vstack([s1 - order * s, c - c1])
    return np.stack([position, velocity, acceleration])
