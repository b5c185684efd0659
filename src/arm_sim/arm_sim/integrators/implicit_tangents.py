# SPDX-License-Identifier: Apache-2.0
"""Derivative of the extrapolated linearly implicit step, see ``extrapolation``.

A part of length h solves A d = h (g + h J_q v), A = I - h J_w - h² [J_q, 0], and moves by
Δ = (h (v + d_q), d), with g at the beginning y of the part and J at that of the whole step, x.
Then

    A dd = h (dg + h J_q dv + d(J Δ)) + dh (g + J_w d + 2 J_q Δq),

where d(J Δ) is the change of J along x and what is held, at fixed Δ: second derivatives of g along
one direction, so that J is never differentiated as a matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from arm_sim.integrators import extrapolation as implicit
from arm_sim.plant.slopes import Slopes

type Symbolic = ca.MX | ca.SX


class _Part(NamedTuple):
    """Coefficients of one part of a step.

    Attributes:
        slopes: Those of the derivative of f at its beginning, see ``Slopes``.
        bend: Derivatives of J Δ by x and by what is held, column by column.
        by_length: g + J_w d + 2 J_q Δq.
        rate: Δq / h.
    """

    slopes: Symbolic
    bend: Symbolic
    by_length: Symbolic
    rate: Symbolic


class _Division(NamedTuple):
    """Coefficients of a division of the step into parts of equal length, with the factors of A."""

    factors: Symbolic
    parts: list[_Part]


class _Coefficients(NamedTuple):
    """What the derivative of a step consists of: its length, J_q, and its divisions."""

    h: Symbolic
    J_q: Symbolic
    divisions: list[_Division]

    def vector(self) -> Symbolic:
        """All of them, one below the other."""
        entries = [self.h, self.J_q]
        for factors, parts in self.divisions:
            entries.append(factors)
            for part in parts:
                entries += part
        return ca.vertcat(*entries)

    def symbols(self) -> _Coefficients:
        """Symbols in place of the expressions."""

        def symbol(expression: Symbolic) -> ca.SX:
            return ca.SX.sym("c", expression.shape[0])

        divisions = [
            _Division(symbol(factors), [_Part(*map(symbol, part)) for part in parts])
            for factors, parts in self.divisions
        ]
        return _Coefficients(symbol(self.h), symbol(self.J_q), divisions)


def implicit_tangent(
    rhs: ca.Function, slopes: Slopes, n: int, tuned: Sequence[int]
) -> tuple[ca.Function, ca.Function]:
    """Compose the derivative of one step.

    Args:
        rhs: Function (x, u, p) -> x'.
        slopes: Its derivatives.
        n: Degrees of freedom.
        tuned: Places in p of the quantities to differentiate by, those of ``slopes``.

    Returns:
        As ``tangents.build_tangent``.
    """
    x, u, p = (ca.MX.sym(name, rhs.size1_in(i)) for i, name in enumerate("xup"))
    h, bend = ca.MX.sym("h"), _bending(rhs, n, tuned)
    J_q, J_w = implicit.jacobian(rhs, n).call([x, u, p])
    factor = implicit.factored(n, J_w.sparsity(), J_q.sparsity())
    solve = implicit.solved(n, factor.sparsity_out(0), J_q.sparsity())
    coefficients, row = _Coefficients(h, _entries(J_q), []), list[ca.MX]()
    for j, count in enumerate(implicit.PARTS):
        length, moved, parts = h / count, ca.MX.zeros(x.shape[0]), list[_Part]()
        LU = factor(J_q, J_w, length)
        for _ in range(count):
            y = x + moved
            slope, c = rhs(y, u, p), slopes.coefficients(y, u, p)[1]
            change = solve(LU, J_q, y, slope, length)
            by_length = slope[n:] + J_w @ change[n:] + 2.0 * (J_q @ change[:n])
            parts.append(_Part(c, bend(x, u, p, change), by_length, change[:n] / length))
            moved = moved + change
        coefficients.divisions.append(_Division(_entries(LU), parts))
        row = implicit.extrapolated(row, moved, j)
    results = [x + row[-1], ca.densify(coefficients.vector())]
    advance = ca.Function("advance", [x, u, p, h], results, {"cse": True})
    patterns = J_q.sparsity(), factor.sparsity_out(0)
    return advance, _propagation(slopes, n, coefficients.symbols(), *patterns)


def _entries(matrix: ca.MX) -> ca.MX:
    return ca.reshape(matrix.nz[:], matrix.nnz(), 1)


def _bending(rhs: ca.Function, n: int, tuned: Sequence[int]) -> ca.Function:
    """Function (x, u, p, Δ) -> derivatives of J Δ by x and by what is held, at fixed Δ, dense."""
    x, u, p = (ca.SX.sym(name, rhs.size1_in(i)) for i, name in enumerate("xup"))
    d, held = ca.SX.sym("d", x.shape[0]), ca.vertcat(u, p[list(tuned), :])
    along = ca.jtimes(rhs(x, u, p)[n:], x, d)
    bent = ca.vec(ca.densify(ca.jacobian(along, ca.vertcat(x, held))))
    return ca.Function("bend", [x, u, p, d], [bent], {"cse": True})


def _propagation(
    slopes: Slopes, n: int, c: _Coefficients, of_q: ca.Sparsity, of_LU: ca.Sparsity
) -> ca.Function:
    """Function (c, dx, dw, dh) -> dx at the end."""
    dx, dw = (ca.SX.sym(name, slopes.carried.size1_in(i)) for i, name in ((1, "dx"), (2, "dw")))
    dh, nx = ca.SX.sym("dh"), dx.shape[0]
    m, J_q, row = nx - n, ca.SX(of_q, c.J_q), list[ca.SX]()
    order = implicit.pivots(n, m, False)
    for j, (factors, parts) in enumerate(c.divisions):
        length, dlength, moved = c.h / len(parts), dh / len(parts), ca.SX(nx, 1)
        LU = ca.SX(of_LU, factors)
        for part in parts:
            dy = dx + moved
            dg = slopes.carried(part.slopes, dy, dw)[n:]
            bent = ca.reshape(part.bend, m, -1) @ ca.vertcat(dx, dw)
            d = length * (dg + length * (J_q @ dy[n : 2 * n]) + bent) + dlength * part.by_length
            d = implicit.substituted(LU, d, order)
            dq = dlength * part.rate + length * (dy[n : 2 * n] + d[:n])
            moved = moved + ca.vertcat(dq, d)
        row = implicit.extrapolated(row, moved, j)
    return ca.Function("propagate", [c.vector(), dx, dw, dh], [dx + row[-1]], {"cse": True})
