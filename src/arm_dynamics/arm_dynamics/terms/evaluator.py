# SPDX-License-Identifier: Apache-2.0
"""Terms of an arm as numbers, for single states and batches."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, each
from arm_dynamics.codegen.rows import Rows
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.terms.arm import NumericArm
from arm_dynamics.terms.compiled import Request, rows
from arm_dynamics.terms.table import FIXED, SIZES, Entry

# Rows from which a batch is worth compiling code.
MANY = 256


class TermEvaluator:
    """Computes terms for vectors of shape (n,) or batches (k, n) that have been validated already.

    Pinocchio does that point by point; from ``MANY`` points, compiled code does, which is built on
    first use where possible. For one thread at a time.
    """

    def __init__(self, model: ArmModel, friction: SteadyFriction) -> None:
        self._model, self._friction = model, friction
        self.numbers = NumericArm(model, friction)
        self._built: dict[Request, Rows | None] = {}

    def __call__(self, entry: Entry, *arguments: Array, selection: tuple[Any, ...] = ()) -> Array:
        """The result of an entry, its shape after (k,) for a batch; see ``Entry``.

        Single vectors among batches are shared by all points; ``selection`` are no numbers.
        """

        def point(*state: Array) -> Array:
            return np.asarray(entry.formula(self.numbers, *state, *selection))

        if arguments[0].ndim != 2 or len(arguments[0]) < MANY:
            return each(point, *arguments)
        if (entry, selection) not in self._built:
            self._built[entry, selection] = rows(self._model, self._friction, [(entry, selection)])
        if (built := self._built[entry, selection]) is None:
            return each(point, *arguments)
        absent = entry.arguments[len(arguments) :]
        arguments += tuple(np.full(SIZES[x] or self._model.n, FIXED[x]) for x in absent)
        return self._compiled(entry, built, point, arguments)

    def _compiled(
        self, entry: Entry, built: Rows, point: Callable[..., Array], arguments: Sequence[Array]
    ) -> Array:
        """The results of compiled code for all arguments of an entry.

        A row that is not finite is computed again by Pinocchio, whose error says why.
        """
        shape = entry.dimensions(self._model.n)
        results = np.hstack(built(*arguments)).reshape(len(arguments[0]), *shape)
        failed = ~np.isfinite(results).reshape(len(results), -1).all(axis=1)
        if failed.any():
            results[failed] = each(point, *(x[failed] if x.ndim == 2 else x for x in arguments))
        return results
