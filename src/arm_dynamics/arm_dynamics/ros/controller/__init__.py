# SPDX-License-Identifier: Apache-2.0
"""Parts of the controller node: its parameters, its goals, and the log of its answers.

Depends on the core, the interfaces, ``common`` and ``joint_state``; neither on the node nor on the
services of the dynamics node.
"""

from arm_dynamics.ros.controller.answer_log import AnswerLog
from arm_dynamics.ros.controller.compiled_answers import CompiledAnswers, Parts
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.ros.controller.jumps import Jumps
from arm_dynamics.ros.controller.selection import ControllerSelection
from arm_dynamics.ros.controller.state_source import StateSource
from arm_dynamics.ros.controller.tracking import TrackingTopic
from arm_dynamics.ros.controller.trajectory_action import TrajectoryAction

__all__ = [
    "AnswerLog", "CompiledAnswers", "ControllerParams", "ControllerSelection", "Goals", "Jumps",
    "Parts", "StateSource", "TrackingTopic", "TrajectoryAction",
]  # fmt: skip
