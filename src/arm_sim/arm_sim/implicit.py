# SPDX-License-Identifier: Apache-2.0
"""A method for stiff scenes: the linearly implicit Euler method, extrapolated to order 4.

Deuflhard, "Recent progress in extrapolation methods for ordinary differential equations", SIAM
Review 27(4), 1985; Hairer, Wanner, Solving Ordinary Differential Equations II, 1996, section IV.9.
The step is divided into 1, 2, 3 and 4 parts, each advanced by (I - h J) Δ = h f with the exact
Jacobian at its beginning, and the four results are extrapolated to h = 0. The last two columns of
the table estimate the error.

With x = (q, v) and f = (v, a) the system of 2n equations reduces to n:
(I - h ∂a/∂v - h² ∂a/∂q) Δv = h (a + h ∂a/∂q v), Δq = h (v + Δv).
"""

from __future__ import annotations

import casadi as ca

PARTS = (1, 2, 3, 4)
ORDER = len(PARTS)
SOURCE = "Deuflhard, SIAM Review 27(4), 1985"


def extrapolated_step(
    rhs: ca.Function, n: int, x: ca.MX, u: ca.MX, p: ca.MX, h: ca.MX
) -> tuple[ca.MX, ca.MX]:
    """Compose one step.

    Args:
        rhs: Function (x, u, p) -> x' with x = (q, v).
        n: Degrees of freedom.
        x: State, shape (2n,).
        u: Torque, shape (n,).
        p: Parameters.
        h: Length of the step in [s].

    Returns:
        State at the end, and an estimate of its error, both of shape (2n,).
    """
    J_q, J_v = _jacobian(rhs, n)(x, u, p)
    factor, solve = _factor(n), _solve(n)
    row: list[ca.MX] = []
    for j, parts in enumerate(PARTS):
        length, moved = h / parts, ca.MX.zeros(2 * n)
        factors = factor(J_q, J_v, length)
        for _ in range(parts):
            y = x + moved
            moved = moved + solve(factors, J_q, y, rhs(y, u, p), length)
        above, row = row, [moved]
        for k in range(j):
            ratio = parts / PARTS[j - k - 1]
            row.append(row[k] + (row[k] - above[k]) / (ratio - 1.0))
    return x + row[-1], row[-1] - row[-2]


def _jacobian(rhs: ca.Function, n: int) -> ca.Function:
    """Exact ∂a/∂q and ∂a/∂v."""
    x, u, p = (ca.SX.sym(name, rhs.size1_in(i)) for i, name in enumerate(("x", "u", "p")))
    J = ca.densify(ca.jacobian(rhs(x, u, p)[n:], x))
    return ca.Function("jacobian", [x, u, p], [J[:, :n], J[:, n:]], {"cse": True})


def _factor(n: int) -> ca.Function:
    """LU factors of I - h J_v - h² J_q in one matrix; the identity dominates, so no pivoting."""
    J_q, J_v, h = ca.SX.sym("J_q", n, n), ca.SX.sym("J_v", n, n), ca.SX.sym("h")
    A = ca.SX.eye(n) - h * (J_v + h * J_q)
    for k in range(n):
        for i in range(k + 1, n):
            A[i, k] = A[i, k] / A[k, k]
            A[i, k + 1 :] = A[i, k + 1 :] - A[i, k] * A[k, k + 1 :]
    return ca.Function("factor", [J_q, J_v, h], [ca.densify(A)], {"cse": True})


def _solve(n: int) -> ca.Function:
    """What one linearly implicit Euler step adds to x; small, so nothing is rounded off."""
    LU, J_q, h = ca.SX.sym("LU", n, n), ca.SX.sym("J_q", n, n), ca.SX.sym("h")
    x, slope = ca.SX.sym("x", 2 * n), ca.SX.sym("f", 2 * n)
    v = x[n:]
    d = h * (slope[n:] + h * (J_q @ v))
    for i in range(n):
        d[i] = d[i] - LU[i, :i] @ d[:i] if i else d[i]
    for i in reversed(range(n)):
        rest = LU[i, i + 1 :] @ d[i + 1 :] if i < n - 1 else 0
        d[i] = (d[i] - rest) / LU[i, i]
    return ca.Function(
        "solve", [LU, J_q, x, slope, h], [ca.vertcat(h * (v + d), d)], {"cse": True}
    )
