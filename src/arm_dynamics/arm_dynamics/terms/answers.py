# SPDX-License-Identifier: Apache-2.0
"""Terms of an arm as numbers, for single states and batches."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, each
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.terms.arm import Numbers
from arm_dynamics.terms.compiled import Asked, Rows, rows
from arm_dynamics.terms.table import FIXED, SIZES, Entry

# Rows from which a batch is worth compiling code.
MANY = 256


class Answers:
    """Terms for vectors of shape (n,) or batches (k, n) that have been validated already.

    Pinocchio computes them point by point; from ``MANY`` points, compiled code does, which is
    built on first use where possible. For one thread at a time.
    """

    def __init__(self, model: ArmModel, friction: SteadyFriction) -> None:
        self._model, self._friction = model, friction
        self.numbers = Numbers(model, friction)
        self._built: dict[Asked, Rows | None] = {}

    def __call__(self, entry: Entry, *given: Array, which: tuple[Any, ...] = ()) -> Array:
        """The result of an entry, its shape after (k,) for a batch; see ``Entry``.

        Single vectors among batches are shared by all points; ``which`` are no numbers.
        """

        def point(*state: Array) -> Array:
            return np.asarray(entry.formula(self.numbers, *state, *which))

        if given[0].ndim != 2 or len(given[0]) < MANY:
            return each(point, *given)
        if (entry, which) not in self._built:
            self._built[entry, which] = rows(self._model, self._friction, [(entry, which)])
        if (built := self._built[entry, which]) is None:
            return each(point, *given)
        fixed = (np.full(SIZES[x] or self._model.n, FIXED[x]) for x in entry.of[len(given) :])
        given = *given, *fixed
        made = np.hstack(built(*given)).reshape(len(given[0]), *entry.dimensions(self._model.n))
        lost = ~np.isfinite(made).reshape(len(made), -1).all(axis=1)
        if lost.any():  # Pinocchio's terms say why
            made[lost] = each(point, *(x[lost] if x.ndim == 2 else x for x in given))
        return made
