# SPDX-License-Identifier: Apache-2.0
"""Convex quadratic programs by a primal-dual interior-point method.

Mehrotra, "On the implementation of a primal-dual interior point method", SIAM J. Optim. 2, 1992.
All iterates are inside the constraints.
"""

import numpy as np

from arm_dynamics.arrays import Array

# Most steps, gap and residual at the solution, and part of the way to the edge.
STEPS, GAP, RESIDUAL, STEP_FRACTION = 80, 1e-13, 1e-9, 0.99
# Shift of the pivots of the normal equations, relative to the diagonal, above rounding.
REGULARIZATION = 1e-14


def quadratic_program(P: Array, c: Array, G: Array, h: Array, y: Array) -> tuple[Array, Array]:
    """Minimize ½ yᵀP y + cᵀy under h + G y ≥ 0.

    Args:
        P: Positive semidefinite, shape (d, d).
        c: Shape (d,).
        G: Shape (k, d).
        h: Shape (k,).
        y: A point inside the constraints, shape (d,).

    Returns:
        The minimum, shape (d,), and the multipliers of the constraints, shape (k,).
    """
    z, count = np.full(len(h), 1.0 / len(h)), len(h)
    for _ in range(STEPS):
        s, residual = h + G @ y, G.T @ z - P @ y - c
        gap = float(s @ z)
        if not (s > 0.0).all() or (gap <= GAP and abs(residual).max() <= RESIDUAL):
            break
        K = P + G.T @ (G * (z / s)[:, None])
        K = K + REGULARIZATION * np.diag(np.diag(K))
        change = -s * z
        for target in (0.0, None):
            dy = np.linalg.solve(K, residual + G.T @ (change / s))
            ds = G @ dy
            dz = (change - z * ds) / s
            room = np.concatenate([-s[ds < 0.0] / ds[ds < 0.0], -z[dz < 0.0] / dz[dz < 0.0]])
            length = float(room.min(initial=np.inf))
            if target is not None:
                centre = (1.0 - min(1.0, length)) ** 3 * gap / count
                change = centre - s * z - ds * dz
        step = min(1.0, STEP_FRACTION * length)
        y, z = y + step * dy, z + step * dz
    return y, z
