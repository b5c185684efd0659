# SPDX-License-Identifier: Apache-2.0
"""What integrates the equations of motion of a robot arm."""

from arm_sim.actuation import CompiledControl, computed_torque
from arm_sim.exceptions import SimulationDiverged
from arm_sim.plan import Plan
from arm_sim.recording import Recording
from arm_sim.simulator import Simulator
from arm_sim.state import State

__all__ = [
    "CompiledControl",
    "Plan",
    "Recording",
    "SimulationDiverged",
    "Simulator",
    "State",
    "computed_torque",
]
