# SPDX-License-Identifier: Apache-2.0
"""Gauss' principle of least constraint as linear algebra, for batches of points.

The acceleration is that nearest to the unconstrained one, in the metric of M, with A a + γ = 0; λ
is of least norm where rows are dependent (Udwadia, Kalaba, Analytical Dynamics, 1996, chapter 3).
"""

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.model.loops.mass_metric import RANK, cholesky, whitened


def constrained_motion(
    M: Array, forces: Array, A: Array, drift: Array, rank: int
) -> tuple[Array, Array]:
    """Accelerations and multipliers of M a + Aᵀλ = forces under A a + γ = 0.

    Args:
        M: Mass matrices, shape (k, n, n).
        forces: Generalized forces, shape (k, n).
        A: Rows of the constraints, shape (k, m, n).
        drift: γ, shape (k, m).
        rank: Largest number of independent rows.

    Returns:
        a of shape (k, n) and λ of shape (k, m).

    Raises:
        ModelError: If a mass matrix is not positive definite.
    """
    C = cholesky(M)
    U, s, Vt = np.linalg.svd(whitened(C, A), full_matrices=False)
    independent = (s > RANK * s[:, :1]) & (np.arange(s.shape[1]) < rank)
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=independent)
    x = np.linalg.solve(C, forces[..., None])[..., 0]
    required = inverse * times(transposed(U), -drift)
    correction = required - independent * times(Vt, x)
    a = np.linalg.solve(transposed(C), (x + times(transposed(Vt), correction))[..., None])
    return a[..., 0], -times(U, correction * inverse)


def times(matrices: Array, vectors: Array) -> Array:
    """Products of matrices (…, m, n) and vectors (…, n), shape (…, m)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def transposed(matrices: Array) -> Array:
    """Each matrix transposed."""
    return np.swapaxes(matrices, -1, -2)
