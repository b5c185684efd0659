# SPDX-License-Identifier: Apache-2.0
"""The factorization M = LᵀDL of symmetric positive definite matrices, such as mass matrices.

Eliminating the leaves of a tree first preserves the zeros of M due to branches (Featherstone,
Rigid Body Dynamics Algorithms, 2008, section 6.5).
"""

import casadi as ca


def solve(M: ca.SX, b: ca.SX) -> ca.SX:
    """Solve M x = b for symmetric positive definite M and one right side of shape (n,)."""
    F = factorize(M)
    x = solve_upper(F, b)
    for k in range(M.shape[0]):
        x[k] = x[k] / F[k, k]
    return solve_lower(F, x)


def solve_columns(M: ca.SX, B: ca.SX) -> ca.SX:
    """Solve M X = B for every column; common subexpressions are computed once (``cse``)."""
    return ca.horzcat(*[solve(M, column) for column in ca.horzsplit(B)])


def factorize(M: ca.SX) -> ca.SX:
    """L and D of M = LᵀDL in one matrix: D on the diagonal, L (unit diagonal omitted) below it."""
    F = ca.SX(M)
    for k in reversed(range(M.shape[0])):
        for i in reversed(range(k)):
            if not F.sparsity().has_nz(k, i):
                continue
            factor = F[k, i] / F[k, k]
            for j in range(i + 1):
                if F.sparsity().has_nz(k, j):
                    F[i, j] = F[i, j] - factor * F[k, j]
            F[k, i] = factor
    return F


def solve_upper(F: ca.SX, b: ca.SX) -> ca.SX:
    """L^-ᵀ b for the factors of M and columns b of shape (n, k)."""
    x = ca.SX(b)
    for k in reversed(range(F.shape[0])):
        for i in reversed(range(k)):
            if F.sparsity().has_nz(k, i):
                x[i, :] = x[i, :] - F[k, i] * x[k, :]
    return x


def solve_lower(F: ca.SX, b: ca.SX) -> ca.SX:
    """L⁻¹ b for the factors of M and a vector b of shape (n,)."""
    x = ca.SX(b)
    for k in range(F.shape[0]):
        for i in range(k):
            if F.sparsity().has_nz(k, i):
                x[k] = x[k] - F[k, i] * x[i]
    return x
