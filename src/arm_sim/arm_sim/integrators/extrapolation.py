# SPDX-License-Identifier: Apache-2.0
"""A method for stiff scenes: the linearly implicit Euler method with extrapolation to order 4.

Deuflhard, "Recent progress in extrapolation methods for ordinary differential equations", SIAM
Review 27(4), 1985; Hairer, Wanner, Solving Ordinary Differential Equations II, 1996, section IV.9.
The step is divided into 1, 2, 3 and 4 parts, each advanced by (I - h J) Δ = h f with the exact
Jacobian at its beginning, and the four results are extrapolated to h = 0. The last two columns of
the table estimate the error; with states z, so does the deviation of the derivative at the end
from its extrapolation.

With x = (q, w), w = (v, z) and f = (v, g) the system reduces to the order of w:
(I - h ∂g/∂w - h² [∂g/∂q, 0]) Δw = h (g + h ∂g/∂q v), Δq = h (v + Δv).
For a long arm both sides are multiplied by a matrix H that makes the system sparse.
"""

import casadi as ca

PARTS = (1, 2, 3, 4)  # numbers of parts of a step, the harmonic sequence
ORDER = len(PARTS)
SOURCE = "Deuflhard, SIAM Review 27(4), 1985"


def extrapolated_step(
    rhs: ca.Function, n: int, x: ca.MX, u: ca.MX, p: ca.MX, h: ca.MX,
    scaled: ca.Function | None = None,
) -> tuple[ca.MX, ca.MX, ca.MX]:  # fmt: skip
    """Build one step.

    Args:
        rhs: Function (x, u, p) -> x' with x = (q, v, z).
        n: Degrees of freedom.
        scaled: Function (x, u, p, x') -> H ∂g/∂q, H ∂g/∂w, H of an invertible H, see
            ``slopes.scaled_jacobian``; None for H = 1.
        x: State, shape (nx,).
        u: Torque, shape (n,).
        p: Parameters.
        h: Length of the step in [s].

    Returns:
        State at the end, an estimate of its error, and the state in the middle, extrapolated from
        the results of two and four parts; each of shape (nx,).
    """
    if scaled is None:
        J_q, J_w, *H = jacobian(rhs, n).call([x, u, p])
    else:
        J_q, J_w, *H = scaled.call([x, u, p, rhs(x, u, p)])
    patterns = J_q.sparsity(), *(matrix.sparsity() for matrix in H)
    factor = lu_function(n, J_w.sparsity(), *patterns)
    solve = euler_step(n, factor.sparsity_out(0), *patterns)
    row: list[ca.MX] = []
    halfway: dict[int, ca.MX] = {}
    for j, parts in enumerate(PARTS):
        length, increment, slopes = h / parts, ca.MX.zeros(x.shape[0]), list[ca.MX]()
        factors = factor(J_q, J_w, length, *H)
        for part in range(parts):
            y = x + increment
            if 2 * part == parts:
                halfway[parts] = increment
            slopes.append(rhs(y, u, p))
            increment = increment + solve(factors, J_q, y, slopes[-1], length, *H)
        row = extrapolate_row(row, increment, j)
    estimate = row[-1] - row[-2]
    if x.shape[0] > 2 * n:
        deviation = _deviation(rhs(x + row[0], u, p), slopes)
        at_rest = ca.MX.zeros(x.shape[0])
        error = solve(factor(J_q, J_w, h, *H), J_q, at_rest, deviation, h, *H)
        estimate = ca.fmax(ca.fabs(estimate), ca.fabs(error))
    return x + row[-1], estimate, x + 2.0 * halfway[4] - halfway[2]


def extrapolate_row(above: list[ca.MX], first: ca.MX, j: int) -> list[ca.MX]:
    """Row j of the table, from the row above and its first entry."""
    row = [first]
    for k in range(j):
        ratio = PARTS[j] / PARTS[j - k - 1]
        row.append(row[k] + (row[k] - above[k]) / (ratio - 1.0))
    return row


def _deviation(end: ca.MX, slopes: list[ca.MX]) -> ca.MX:
    """Derivative at the end less the cubic through those at the beginnings of the four parts.

    A model with states may have a kink: bristles reverse with the sign of a velocity. In the last
    part of the step nothing else would detect it.
    """
    a, b, c, d = slopes
    return end - (4.0 * d - 6.0 * c + 4.0 * b - a)


def jacobian(rhs: ca.Function, n: int) -> ca.Function:
    """Exact ∂g/∂q and ∂g/∂w; dense without internal states, else sparse."""
    x, u, p = (ca.SX.sym(name, rhs.size1_in(i)) for i, name in enumerate(("x", "u", "p")))
    J = ca.jacobian(rhs(x, u, p)[n:], x)
    J = ca.densify(J) if x.shape[0] == 2 * n else J
    return ca.Function("jacobian", [x, u, p], [J[:, :n], J[:, n:]], {"cse": True})


def pivots(n: int, m: int, scaled: bool) -> list[int]:
    """Pivot order: internal states first, since each couples to few others, then velocities.

    Velocities of a scaled system are ordered from the tips, which preserves the zeros due to
    branches.
    """
    return [*range(n, m), *(reversed(range(n)) if scaled else range(n))]


def lu_function(n: int, J_w: ca.Sparsity, J_q: ca.Sparsity, *scale: ca.Sparsity) -> ca.Function:
    """LU factors of H - h ∂g/∂w - h² [∂g/∂q, 0] in one matrix; H = 1 unless its pattern is given.

    No pivoting: for a passive model J = (S - D) H with S skew, D and H positive, so that I - h J =
    (1/H + h D - h S) H has a positive symmetric part up to the factor H, and so has every leading
    block: no pivot vanishes, in any order, at any h (Golub, Van Loan, Matrix Computations, 4th
    edition, section 4.4.2). The same holds for M + h D - h S, the scaled system. Where a model
    supplies energy, h is small.
    """
    m = J_w.size1()
    Q, W, h = ca.SX.sym("J_q", J_q), ca.SX.sym("J_w", J_w), ca.SX.sym("h")
    H = [ca.SX.sym("H", pattern) for pattern in scale]
    wide = Q if m == n else ca.horzcat(Q, ca.SX(m, m - n))
    A = (*H, ca.SX.eye(m))[0] - h * (W + h * wide)
    order = pivots(n, m, bool(H))
    for step, k in enumerate(order):
        rest = [j for j in order[step + 1 :] if A.sparsity().has_nz(k, j)]
        for i in order[step + 1 :]:
            if A.sparsity().has_nz(i, k):
                A[i, k] = A[i, k] / A[k, k]
                for j in rest:
                    A[i, j] = A[i, j] - A[i, k] * A[k, j]
    return ca.Function("factor", [Q, W, h, *H], [A], {"cse": True})


def euler_step(n: int, factors: ca.Sparsity, J_q: ca.Sparsity, *scale: ca.Sparsity) -> ca.Function:
    """Increment of x in one linearly implicit Euler step, which avoids cancellation."""
    m = factors.size1()
    LU, Q, h = ca.SX.sym("LU", factors), ca.SX.sym("J_q", J_q), ca.SX.sym("h")
    x, slope = ca.SX.sym("x", n + m), ca.SX.sym("f", n + m)
    H = [ca.SX.sym("H", pattern) for pattern in scale]
    v, order = x[n : 2 * n], pivots(n, m, bool(H))
    right = h * ((H[0] @ slope[n:] if H else slope[n:]) + h * (Q @ v))
    d = substitute(LU, right, order)
    arguments, increment = [LU, Q, x, slope, h, *H], ca.vertcat(h * (v + d[:n]), d)
    return ca.Function("solve", arguments, [increment], {"cse": True})


def substitute(LU: ca.SX, right: ca.SX, order: list[int]) -> ca.SX:
    """Solution for a right side, of a system whose factors ``LU`` were eliminated in an order."""
    d = ca.SX(right)

    def known_terms(i: int, columns: list[int]) -> ca.SX:
        return sum((LU[i, j] * d[j] for j in columns if LU.has_nz(i, j)), ca.SX(0.0))

    for step, i in enumerate(order):
        d[i] = d[i] - known_terms(i, order[:step])
    for step, i in reversed(list(enumerate(order))):
        d[i] = (d[i] - known_terms(i, order[step + 1 :])) / LU[i, i]
    return d
