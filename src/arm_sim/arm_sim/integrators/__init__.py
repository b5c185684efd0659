# SPDX-License-Identifier: Apache-2.0
"""One-step methods: tableaux, construction of a step from an equation of motion, and selection.

A method states its order, its source and whether it estimates its own error. Depends on plants,
and not on events or on how steps are run.
"""

from arm_sim.integrators.methods import METHODS, Method
from arm_sim.integrators.selection import Choice, choose
from arm_sim.integrators.steps import build_step, build_tick
from arm_sim.integrators.tableaux import Tableau

__all__ = ["METHODS", "Choice", "Method", "Tableau", "build_step", "build_tick", "choose"]
