# SPDX-License-Identifier: Apache-2.0
"""What a law with states costs by itself."""

from __future__ import annotations

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics.actuation.internal_state import StatefulLaw
from arm_dynamics.codegen.kernel import Kernel, operations

EVALUATIONS = 1000
REPEATS = 20


@dataclass(frozen=True)
class LawCost:
    """A law and what one evaluation of it costs.

    Attributes:
        title: Which law.
        states: Its states, for people.
        operations: Arithmetic operations of one evaluation; a step takes several.
        nanoseconds: Time of one evaluation in [ns], measured.
    """

    title: str
    states: tuple[str, ...]
    operations: int
    nanoseconds: float

    def __str__(self) -> str:
        """A line for people."""
        number = len(self.states)
        count = f"{number or 'no'} state{'s' if number > 1 else ''}"
        cost = f"{self.operations} operations, {self.nanoseconds:.0f} ns an evaluation"
        return f"{self.title}: {count}, {cost}"


def cost_of(law: StatefulLaw, n: int, backend: str) -> LawCost:
    """Measure a law, many evaluations in one call.

    Args:
        law: The law.
        n: Degrees of freedom.
        backend: As for ``Kernel``.
    """
    symbols = [ca.SX.sym(name, size) for name, size in _sizes(law, n).items()]
    flow = law.equations(*symbols)
    results = [ca.densify(flow.torque), ca.densify(flow.slope)]
    once = ca.Function("law", symbols, results, {"cse": True})
    many = once.map("laws", "serial", EVALUATIONS, [], [], {})
    call, best = Kernel([many], backend).call("laws"), np.inf
    for place in call.inputs:
        place[...] = 0.1
    for _ in range(REPEATS):
        start = time.perf_counter_ns()
        call.run()
        best = min(best, (time.perf_counter_ns() - start) / EVALUATIONS)
    return LawCost(law.title, law.names, operations(once), best)


def _sizes(law: StatefulLaw, n: int) -> dict[str, int]:
    return {"q": n, "v": n, "z": len(law.names), "u": n}
