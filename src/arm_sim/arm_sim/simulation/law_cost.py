# SPDX-License-Identifier: Apache-2.0
"""Measured cost of the laws of drives and friction."""

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics.actuation.internal_state import StatefulLaw
from arm_dynamics.codegen.kernel import Kernel, operations
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.exceptions import counted

EVALUATIONS = 1000  # of a law in one run
RUNS = 20  # of which the fastest counts
INPUT = 0.1  # value of all arguments


@dataclass(frozen=True)
class LawCost:
    """A law and the cost of one evaluation.

    Attributes:
        title: Name of the law.
        states: Its states, as text.
        operations: Arithmetic operations of one evaluation; a step takes several.
        nanoseconds: Time of one evaluation in [ns], measured.
    """

    title: str
    states: tuple[str, ...]
    operations: int
    nanoseconds: float

    def __str__(self) -> str:
        """One line of text."""
        cost = f"{counted(self.operations, 'operation')}, {self.nanoseconds:.0f} ns per evaluation"
        return f"{self.title}: {counted(len(self.states), 'state')}, {cost}"


@one_at_a_time
def measure_law(law: StatefulLaw, n: int, backend: str) -> LawCost:
    """Measure a law, many evaluations in one call."""
    sizes = {"q": n, "v": n, "z": len(law.states), "u": n}
    symbols = [ca.SX.sym(name, size) for name, size in sizes.items()]
    flow = law.equations(*symbols)
    results = [ca.densify(flow.torque), ca.densify(flow.slope)]
    f = ca.Function("law", symbols, results, {"cse": True})
    batch = f.map("laws", "serial", EVALUATIONS, [], [], {})
    call, fastest = Kernel([batch], backend).call("laws"), np.inf
    for place in call.inputs:
        place[...] = INPUT
    for _ in range(RUNS):
        start = time.perf_counter_ns()
        call.run()
        fastest = min(fastest, (time.perf_counter_ns() - start) / EVALUATIONS)
    return LawCost(law.title, tuple(state.name for state in law.states), operations(f), fastest)
