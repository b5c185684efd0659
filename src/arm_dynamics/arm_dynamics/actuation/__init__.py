# SPDX-License-Identifier: Apache-2.0
"""Actuation: drives, and friction models with internal states.

A model defines its states, their derivatives, and the energy that it stores, receives and
dissipates. The package depends on the equations and the model, and on no integrator.
"""

from arm_dynamics.actuation.command_map import rigid_twin
from arm_dynamics.actuation.internal_state import Flow, FrictionLaw, InternalState, StateKind

__all__ = ["Flow", "FrictionLaw", "InternalState", "StateKind", "rigid_twin"]
