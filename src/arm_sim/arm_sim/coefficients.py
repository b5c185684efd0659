# SPDX-License-Identifier: Apache-2.0
"""Numbers that one function computes and another one uses."""

import casadi as ca


class Coefficients:
    """Entries of matrices, as results of the one function and arguments of the other.

    Constants are in neither: the second function contains them.
    """

    def __init__(self) -> None:
        self._values: list[ca.SX] = []
        self._symbols: list[ca.SX] = []

    def substitute(self, expression: ca.SX) -> ca.SX:
        """Register the entries of a matrix; return it with symbols for all but its constants."""
        expression = ca.sparsify(expression)
        entries = [self._register(entry) for entry in expression.nonzeros()]
        return ca.SX(expression.sparsity(), ca.vertcat(*entries)) if entries else expression

    @property
    def values(self) -> ca.SX:
        """The numbers to be computed, a vector."""
        return ca.vertcat(ca.SX(0, 1), *self._values)

    @property
    def symbols(self) -> ca.SX:
        """The symbols, in the same order."""
        return ca.vertcat(ca.SX(0, 1), *self._symbols)

    def _register(self, value: ca.SX) -> ca.SX:
        """The symbol of a value from now on; the value itself if it is a constant."""
        if ca.SX(value).is_constant():
            return value
        self._values.append(value)
        self._symbols.append(ca.SX.sym(f"c{len(self._values)}"))
        return self._symbols[-1]
