# SPDX-License-Identifier: Apache-2.0
"""Case distinctions of expressions as modes, found in their expression graph."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

# Operations on a and b that distinguish cases, and the factor of a - b in the switching function,
# which is not negative where the mode is 1:
#
#     operation    factor    meaning of the mode 1
#     a < b           1      a >= b: the comparison does not hold
#     a <= b         -1      a <= b: the comparison holds
#     fmin(a, b)     -1      a <= b: the result is a
#     fmax(a, b)      1      a >= b: the result is a
_FACTORS = {ca.OP_LT: 1.0, ca.OP_LE: -1.0, ca.OP_FMIN: -1.0, ca.OP_FMAX: 1.0}


@dataclass(frozen=True)
class Switches:
    """Case distinctions of some expressions.

    Attributes:
        results: The expressions, with modes in place of comparisons.
        modes: Symbols of the modes, shape (k,): 1 where a switching function is not negative.
        values: Switching functions, differences of what is compared, shape (k,), without modes.
        sizes: Magnitude of the terms of each, whose rounding is no switch, shape (k,).
    """

    results: list[ca.SX]
    modes: ca.SX
    values: ca.SX
    sizes: ca.SX


def case_modes(results: Sequence[ca.SX], state: ca.SX) -> Switches:
    """Replace the comparisons in expressions that depend on ``state`` by modes.

    Args:
        results: Expressions.
        state: Symbols of the state that may change during a tick.
    """
    of_state = {symbol.element_hash() for symbol in ca.vertsplit(state)}
    symbols = ca.symvar(ca.veccat(*results))
    constant = ca.vertcat(*(s for s in symbols if s.element_hash() not in of_state))
    function = ca.Function("f", [state, constant], list(results), {"cse": True})
    original, modal = _Graph(function, state, constant), _Graph(function, state, constant)
    modes, values, sizes = list[ca.SX](), list[ca.SX](), list[ca.SX]()
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        original.run(k)
        modal.run(k)
        if operation not in _FACTORS or not original.varies:
            continue
        a, b = original.operands
        if ca.is_equal(b, -a, 1):  # an absolute value, which has powers: it must stay positive
            continue
        mode = ca.SX.sym(f"holds{len(modes)}")
        modes.append(mode)
        values.append(_FACTORS[operation] * (a - b))
        sizes.append(ca.fabs(a) + ca.fabs(b))
        if operation in (ca.OP_FMIN, ca.OP_FMAX):
            a, b = modal.operands
            modal.put(k, mode * a + (1.0 - mode) * b)
        else:
            modal.put(k, 1.0 - mode if operation == ca.OP_LT else mode)
    columns = (ca.vertcat(ca.SX(0, 1), *parts) for parts in (modes, values, sizes))
    return Switches(modal.outputs, *columns)


class _Graph:
    """Evaluation of a function's instructions, one after the other, as expressions.

    Attributes:
        operands: Operands of the last operation.
        varies: Whether the last operation depends on the state.
        outputs: Expressions of the results.
    """

    def __init__(self, function: ca.Function, *arguments: ca.SX) -> None:
        self._function, self._arguments = function, arguments
        self._work = [ca.SX(0.0)] * function.sz_w()
        self._varies = np.zeros(function.sz_w(), dtype=bool)
        self.operands, self.varies = list[ca.SX](), False
        self.outputs = [ca.SX(*function.size_out(i)) for i in range(function.n_out())]

    def run(self, k: int) -> None:
        """Evaluate the next instruction, number k."""
        f = self._function
        operation, outputs = f.instruction_id(k), f.instruction_output(k)
        inputs = f.instruction_input(k)
        if operation == ca.OP_CONST:
            self._set(outputs[0], ca.SX(f.instruction_constant(k)), varies=False)
        elif operation == ca.OP_INPUT:
            argument, element = inputs
            self._set(outputs[0], self._arguments[argument].nz[element], varies=argument == 0)
        elif operation == ca.OP_OUTPUT:
            result, element = outputs
            row, column = f.sparsity_out(result).get_triplet()
            self.outputs[result][row[element], column[element]] = self._work[inputs[0]]
        else:
            self.operands = [self._work[i] for i in inputs]
            self.varies = any(self._varies[i] for i in inputs)
            apply = ca.SX.binary if len(inputs) == 2 else ca.SX.unary
            self._set(outputs[0], apply(operation, *self.operands), self.varies)

    def put(self, k: int, value: ca.SX) -> None:
        """Replace the result of an instruction."""
        self._work[self._function.instruction_output(k)[0]] = value

    def _set(self, place: int, value: ca.SX, varies: bool) -> None:
        self._work[place], self._varies[place] = value, varies
