# SPDX-License-Identifier: Apache-2.0
"""What stands between a command and the torque at a joint: drives, and friction with states.

A law says what its states are, how they change, and what it stores, takes in and loses; it knows
equations and the model, and no integrator.
"""

from arm_dynamics.actuation.command_map import CommandMap, rigid_twin
from arm_dynamics.actuation.drives import Drives
from arm_dynamics.actuation.internal_state import Ensemble, Flow, FrictionLaw, StatefulLaw
from arm_dynamics.actuation.joint_laws import FRICTION, friction_laws, laws_of
from arm_dynamics.actuation.lugre_joints import LugreFriction
from arm_dynamics.actuation.steady_friction import SteadyFriction

__all__ = [
    "CommandMap", "Drives", "Ensemble", "FRICTION", "Flow", "FrictionLaw", "LugreFriction",
    "StatefulLaw", "SteadyFriction", "friction_laws", "laws_of", "rigid_twin",
]  # fmt: skip
