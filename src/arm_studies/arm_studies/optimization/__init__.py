# SPDX-License-Identifier: Apache-2.0
"""Trajectory optimization with the simulator's own steps: iLQR with limits.

Depends on simulators and their compiled ticks and derivatives; the cost is any object with
``value`` and ``expansion``.
"""

from arm_studies.optimization.cost import Cost, Expansion, QuadraticCost
from arm_studies.optimization.ilqr import ILQR, Phase, Trajectory, prepare

__all__ = [
    "ILQR", "Cost", "Expansion", "Phase", "QuadraticCost", "Trajectory", "prepare",
]  # fmt: skip
