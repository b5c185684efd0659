# SPDX-License-Identifier: Apache-2.0
"""Compiled ticks of one state or many, with their derivatives.

The engine is C (``native/``): smooth motion between the events of joints that stick and points
in contact. Depends on plants and methods, and not on their users.
"""

from arm_sim.stepping.adaptive import SubstepControl
from arm_sim.stepping.events import EventReport, Modes, Trouble
from arm_sim.stepping.gradient import Gradients, RolloutGradient
from arm_sim.stepping.linearization import Linearizer
from arm_sim.stepping.rollout import Rollouts
from arm_sim.stepping.stepper import Stepper

__all__ = [
    "EventReport",
    "Gradients",
    "Linearizer",
    "Modes",
    "RolloutGradient",
    "Rollouts",
    "Stepper",
    "SubstepControl",
    "Trouble",
]
