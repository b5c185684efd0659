# SPDX-License-Identifier: Apache-2.0
"""Derivative of the extrapolated linearly implicit step, see ``extrapolation``.

A part of length h solves A d = h (g + h J_q v), A = I - h J_w - h² [J_q, 0], and moves by
Δ = (h (v + d_q), d), with g at the beginning y of the part and J at that of the whole step, x.
Then

    A dd = h (dg + h J_q dv + d(J Δ)) + dh (g + J_w d + 2 J_q Δq),

where d(J Δ) is the change of J along x and what is held, at fixed Δ: second derivatives of g along
one direction, so that J is never differentiated as a matrix.
"""

from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

import casadi as ca

from arm_sim.integrators import extrapolation as implicit
from arm_sim.plant.slopes import Slopes


class _Part(NamedTuple):
    """Coefficients of one part of a step.

    Attributes:
        slopes: Coefficients of the derivative of f at its beginning, see ``Slopes``.
        bend: Derivatives of J Δ by x and by what is held, column by column.
        by_length: g + J_w d + 2 J_q Δq.
        rate: Δq / h.
    """

    slopes: ca.MX
    bend: ca.MX
    by_length: ca.MX
    rate: ca.MX


def implicit_tangent(
    rhs: ca.Function, slopes: Slopes, n: int, p_indices: Sequence[int]
) -> tuple[ca.Function, ca.Function]:
    """Compose the derivative of one step.

    Args:
        rhs: Function (x, u, p) -> x'.
        slopes: Derivatives of ``rhs``.
        n: Degrees of freedom.
        p_indices: Indices in p of the quantities to differentiate by, those of ``slopes``.

    Returns:
        As ``tangents.build_tangent``.
    """
    x, u, p = (ca.MX.sym(name, rhs.size1_in(i)) for i, name in enumerate("xup"))
    h, bend_of = ca.MX.sym("h"), _bending(rhs, n, p_indices)
    J_q, J_w = implicit.jacobian(rhs, n).call([x, u, p])
    factor = implicit.lu_function(n, J_w.sparsity(), J_q.sparsity())
    solve = implicit.euler_step(n, factor.sparsity_out(0), J_q.sparsity())
    blocks, increments = [h, _entries(J_q)], list[ca.MX]()
    for j, parts in enumerate(implicit.PARTS):
        length, increment = h / parts, ca.MX.zeros(x.shape[0])
        LU = factor(J_q, J_w, length)
        blocks.append(_entries(LU))
        for _ in range(parts):
            y = x + increment
            slope, slope_coefficients = rhs(y, u, p), slopes.coefficients(y, u, p)[1]
            change = solve(LU, J_q, y, slope, length)
            by_length = slope[n:] + J_w @ change[n:] + 2.0 * (J_q @ change[:n])
            bend = bend_of(x, u, p, change)
            blocks.extend(_Part(slope_coefficients, bend, by_length, change[:n] / length))
            increment = increment + change
        increments = implicit.extrapolate_row(increments, increment, j)
    results = [x + increments[-1], ca.densify(ca.vertcat(*blocks))]
    advance = ca.Function("advance", [x, u, p, h], results, {"cse": True})
    symbols = [ca.SX.sym("c", block.shape[0]) for block in blocks]
    return advance, _propagation(slopes, n, symbols, J_q.sparsity(), factor.sparsity_out(0))


def _entries(matrix: ca.MX) -> ca.MX:
    return ca.reshape(matrix.nz[:], matrix.nnz(), 1)


def _bending(rhs: ca.Function, n: int, p_indices: Sequence[int]) -> ca.Function:
    """Function (x, u, p, Δ) -> derivatives of J Δ by x and by what is held, at fixed Δ, dense."""
    x, u, p = (ca.SX.sym(name, rhs.size1_in(i)) for i, name in enumerate("xup"))
    d, held = ca.SX.sym("d", x.shape[0]), ca.vertcat(u, p[list(p_indices), :])
    derivative = ca.jtimes(rhs(x, u, p)[n:], x, d)
    bend = ca.vec(ca.densify(ca.jacobian(derivative, ca.vertcat(x, held))))
    return ca.Function("bend", [x, u, p, d], [bend], {"cse": True})


def _propagation(
    slopes: Slopes, n: int, c: Sequence[ca.SX], q_pattern: ca.Sparsity, LU_pattern: ca.Sparsity
) -> ca.Function:
    """Function (c, dx, dw, dh) -> dx at the end.

    The blocks of c are h and J_q, then for each division of the step LU and its ``_Part``s.
    """
    dx, dw = (ca.SX.sym(name, slopes.tangent.size1_in(i)) for i, name in ((1, "dx"), (2, "dw")))
    dh, nx = ca.SX.sym("dh"), dx.shape[0]
    m, blocks, increments = nx - n, iter(c), list[ca.SX]()
    h, J_q, order = next(blocks), ca.SX(q_pattern, next(blocks)), implicit.pivots(n, m, False)
    for j, parts in enumerate(implicit.PARTS):
        length, dlength, increment = h / parts, dh / parts, ca.SX(nx, 1)
        LU = ca.SX(LU_pattern, next(blocks))
        for _ in range(parts):
            part, dy = _Part(*islice(blocks, len(_Part._fields))), dx + increment
            dg = slopes.tangent(part.slopes, dy, dw)[n:]
            bend = ca.reshape(part.bend, m, -1) @ ca.vertcat(dx, dw)
            d = length * (dg + length * (J_q @ dy[n : 2 * n]) + bend) + dlength * part.by_length
            d = implicit.substitute(LU, d, order)
            dq = dlength * part.rate + length * (dy[n : 2 * n] + d[:n])
            increment = increment + ca.vertcat(dq, d)
        increments = implicit.extrapolate_row(increments, increment, j)
    arguments, results = [ca.vertcat(*c), dx, dw, dh], [dx + increments[-1]]
    return ca.Function("propagate", arguments, results, {"cse": True})
