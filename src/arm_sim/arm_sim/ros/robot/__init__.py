# SPDX-License-Identifier: Apache-2.0
"""Further topics of a robot besides joint states: description, all joints, and frames.

Depends on the cores, ``arm_dynamics.ros``, the outputs and the engine, but not on the services.
"""

from arm_sim.ros.robot.all_joints import AllJointStates
from arm_sim.ros.robot.display import Display
from arm_sim.ros.robot.robot_params import RobotParams, publish_description

__all__ = ["AllJointStates", "Display", "RobotParams", "publish_description"]
