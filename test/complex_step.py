# SPDX-License-Identifier: Apache-2.0
"""Derivatives of CasADi functions to the last digits, without CasADi's derivatives.

A real function that is evaluated at x + i ε with ε = 1e-30 has its derivative as Im f / ε, without
a difference and so without cancellation (Squire, Trapp, "Using complex variables to estimate
derivatives of real functions", SIAM Review 40, 1998).
"""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

EPSILON = 1e-30
Values = np.ndarray
"""Complex numbers, a column for each point."""


def _choice(wanted: Callable[[Values, Values], Values]) -> Callable[[Values, Values], Values]:
    return lambda a, b: np.where(wanted(a.real, b.real), a, b)


def _truth(wanted: Callable[[Values, Values], Values]) -> Callable[[Values, Values], Values]:
    return lambda a, b: wanted(a.real, b.real).astype(complex)


OPERATIONS: dict[int, Callable[..., Values]] = {
    ca.OP_ASSIGN: lambda a: a, ca.OP_ADD: np.add, ca.OP_SUB: np.subtract, ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide, ca.OP_NEG: np.negative, ca.OP_INV: lambda a: 1.0 / a,
    ca.OP_SQ: lambda a: a * a, ca.OP_TWICE: lambda a: 2.0 * a, ca.OP_SQRT: np.sqrt,
    ca.OP_SIN: np.sin, ca.OP_COS: np.cos, ca.OP_EXP: np.exp, ca.OP_LOG: np.log,
    ca.OP_TANH: np.tanh, ca.OP_POW: np.power, ca.OP_CONSTPOW: np.power, ca.OP_HYPOT: lambda a,
    b: np.sqrt(a * a + b * b), ca.OP_FABS: lambda a: np.where(a.real < 0.0, -a, a),
    ca.OP_SIGN: lambda a: np.sign(a.real).astype(complex),
    ca.OP_FLOOR: lambda a: np.floor(a.real).astype(complex), ca.OP_FMIN: _choice(np.less_equal),
    ca.OP_FMAX: _choice(np.greater_equal), ca.OP_LT: _truth(np.less),
    ca.OP_LE: _truth(np.less_equal), ca.OP_EQ: _truth(np.equal), ca.OP_NE: _truth(np.not_equal),
    ca.OP_AND: _truth(np.logical_and), ca.OP_OR: _truth(np.logical_or),
    ca.OP_NOT: lambda a: (a.real == 0.0).astype(complex),
    ca.OP_IF_ELSE_ZERO: lambda a, b: np.where(a.real != 0.0, b, 0.0),
}  # fmt: skip


def evaluated(function: ca.Function, arguments: Sequence[Values]) -> list[Values]:
    """A CasADi function at complex numbers, of shape (size, k) for k points at once."""
    function = function.expand()
    results = [np.zeros((function.numel_out(i), arguments[0].shape[1]), complex)
               for i in range(function.n_out())]  # fmt: skip
    work: dict[int, Values] = {}
    for k in range(function.n_instructions()):
        kind = function.instruction_id(k)
        into, given = function.instruction_output(k), function.instruction_input(k)
        if kind == ca.OP_INPUT:
            work[into[0]] = arguments[given[0]][given[1]]
        elif kind == ca.OP_CONST:
            work[into[0]] = np.full(arguments[0].shape[1], function.instruction_constant(k) + 0j)
        elif kind == ca.OP_OUTPUT:
            results[into[0]][into[1]] = work[given[0]]
        else:
            with np.errstate(divide="ignore", invalid="ignore"):  # of what is not chosen
                work[into[0]] = OPERATIONS[kind](*(work[i] for i in given))
    return results


def seeded(values: Sequence[np.ndarray]) -> list[Values]:
    """Vectors as columns, one for each of their numbers, which alone has ε i added."""
    count = sum(len(vector) for vector in values)
    columns = np.concatenate(values)[:, None] + EPSILON * 1j * np.eye(count)
    return np.split(columns, np.cumsum([len(vector) for vector in values])[:-1])
