# SPDX-License-Identifier: Apache-2.0
"""One-step methods: tableaux, how a step is built from an equation of motion, and which to take.

A method states its order, its source and whether it estimates its own error. Knows plants, and
nothing of events or of how steps are run.
"""

from arm_sim.integrators.methods import METHODS, Method, build_attempt, build_step, build_tick
from arm_sim.integrators.selection import Choice, choose
from arm_sim.integrators.tableaux import Tableau

__all__ = [
    "METHODS",
    "Choice",
    "Method",
    "Tableau",
    "build_attempt",
    "build_step",
    "build_tick",
    "choose",
]
