# SPDX-License-Identifier: Apache-2.0
"""Compiled ticks of one state or many.

The engine is C (``native/``): smooth motion between the events of joints that stick and points
in contact. Depends on plants and methods, and not on their users.
"""

from arm_sim.stepping.adaptive import SubstepControl
from arm_sim.stepping.events import EventReport, Modes, Trouble
from arm_sim.stepping.rollouts.batch import Batch
from arm_sim.stepping.rollouts.rollout import Rollouts
from arm_sim.stepping.stepper import Stepper

__all__ = ["Batch", "EventReport", "Modes", "Rollouts", "Stepper", "SubstepControl", "Trouble"]
