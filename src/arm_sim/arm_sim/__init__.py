# SPDX-License-Identifier: Apache-2.0
"""Simulates robot arms: M q̈ + C q̇ + G + F = τ, tick by tick.

Names are imported when they are first used, since CasADi and Pinocchio take half a second to
import.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
    from arm_sim.plant.actuation import CompiledControl, computed_torque
    from arm_sim.recording.recording import Recording
    from arm_sim.servo import JointCommand
    from arm_sim.simulation import ClosedLoop, Plan, SimulatedArm, Simulator, contact_history
    from arm_sim.state import State

__version__ = "0.1.0"
__all__ = [
    "ClosedLoop",
    "CompiledControl",
    "JointCommand",
    "NotDifferentiable",
    "Plan",
    "Recording",
    "SimulatedArm",
    "SimulationDiverged",
    "Simulator",
    "State",
    "computed_torque",
    "contact_history",
]
__getattr__, __dir__ = on_demand(__name__, __file__)
