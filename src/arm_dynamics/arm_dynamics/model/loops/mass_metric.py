# SPDX-License-Identifier: Apache-2.0
"""Linear constraints in the metric of the mass matrix M.

In coordinates x = Cᵀ a, with M = C Cᵀ, the metric of M is the identity, and the constraints are
Y x = b with Y = A C^-ᵀ; everything here follows from the singular values of Y.
"""

from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ModelError

# Singular values below this fraction of the largest are treated as zero.
RANK = 1e-9


@dataclass(frozen=True)
class Factors:
    """Singular value decomposition of the constraints in the metric of M, without zero values.

    Attributes:
        C: Lower factor of M = C Cᵀ, shape (n, n).
        U: Shape (m, r).
        s: Singular values in descending order, shape (r,).
        Vt: Shape (r, n).
    """

    C: Array
    U: Array
    s: Array
    Vt: Array

    def nearest(self, b: Array) -> Array:
        """Shortest motion with A a = b in the metric of M, shape (n,)."""
        return np.asarray(np.linalg.solve(self.C.T, self.Vt.T @ (self.U.T @ b / self.s)))


def factored(M: Array, A: Array, rank: int) -> Factors:
    """Factorize rows A, shape (m, n), in the metric of M, with at most ``rank`` singular values.

    Raises:
        ModelError: If M is not positive definite.
    """
    C = cholesky(M)
    U, s, Vt = np.linalg.svd(whitened(C, A), full_matrices=False)
    r = min(rank, int(np.sum(s > RANK * s[0]))) if s.size and s[0] > 0.0 else 0
    return Factors(C, U[:, :r], s[:r], Vt[:r])


def whitened(C: Array, A: Array) -> Array:
    """Rows Y = A C^-ᵀ, shape (…, m, n), for lower factors C of M."""
    return np.swapaxes(np.linalg.solve(C, np.swapaxes(A, -1, -2)), -1, -2)


def cholesky(M: Array) -> Array:
    """Lower factors C of mass matrices M = C Cᵀ, shape (…, n, n).

    Raises:
        ModelError: If one is not positive definite.
    """
    try:
        return np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        raise ModelError(
            "a joint moves no mass; give a link inertia, the joint an armature, or lock it"
        ) from None
