# SPDX-License-Identifier: Apache-2.0
"""The factorization A = L U of square matrices, without pivoting."""

import casadi as ca


def factorize(A: ca.SX) -> ca.SX:
    """Factors of A = L U in one matrix, without pivoting; L has a unit diagonal."""
    F = ca.SX(A)
    for k in range(F.shape[0]):
        for i in range(k + 1, F.shape[0]):
            F[i, k] = F[i, k] / F[k, k]
            F[i, k + 1 :] = F[i, k + 1 :] - F[i, k] * F[k, k + 1 :]
    return F


def solve(F: ca.SX, b: ca.SX) -> ca.SX:
    """Solve L U x = b for the factors of ``factorize``."""
    x = ca.densify(ca.SX(b))
    for i in range(F.shape[0]):
        for j in range(i):
            x[i] -= F[i, j] * x[j]
    for i in reversed(range(F.shape[0])):
        for j in range(i + 1, F.shape[0]):
            x[i] -= F[i, j] * x[j]
        x[i] = x[i] / F[i, i]
    return x
