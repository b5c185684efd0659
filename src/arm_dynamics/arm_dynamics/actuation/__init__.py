# SPDX-License-Identifier: Apache-2.0
"""Actuation: drives, and friction models with internal states.

A model defines its states, their derivatives, and the energy that it stores, receives and
dissipates. The package depends on the equations and the model, and on no integrator.
"""

from arm_dynamics.actuation.command_map import CommandMap, rigid_twin
from arm_dynamics.actuation.drives import Drives
from arm_dynamics.actuation.internal_state import (
    Ensemble,
    Flow,
    FrictionLaw,
    InternalState,
    StatefulLaw,
    StateKind,
)
from arm_dynamics.actuation.joint_laws import FRICTION, friction_laws, laws_of
from arm_dynamics.actuation.lugre_joints import LugreFriction
from arm_dynamics.actuation.steady_friction import SteadyFriction

__all__ = [
    "CommandMap", "Drives", "Ensemble", "FRICTION", "Flow", "FrictionLaw", "InternalState",
    "LugreFriction", "StateKind", "StatefulLaw", "SteadyFriction", "friction_laws", "laws_of",
    "rigid_twin",
]  # fmt: skip
