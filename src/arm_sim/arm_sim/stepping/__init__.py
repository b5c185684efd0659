# SPDX-License-Identifier: Apache-2.0
"""Compiled ticks: one state or many at once, with their derivatives.

The engine is C (``native/``): smooth motion between the events of joints that stick and points
that touch. Knows plants and methods, and nothing of who asks for ticks.
"""

from arm_sim.stepping.adaptive import SubstepControl
from arm_sim.stepping.events import EventReport, Modes, Trouble
from arm_sim.stepping.linearization import Linearizer
from arm_sim.stepping.rollout import Rollouts
from arm_sim.stepping.stepper import Stepper

__all__ = [
    "EventReport",
    "Linearizer",
    "Modes",
    "Rollouts",
    "Stepper",
    "SubstepControl",
    "Trouble",
]
