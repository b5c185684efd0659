# SPDX-License-Identifier: Apache-2.0
"""What ROS expects of a robot beside its joint states: its description, all joints, frames.

It knows the cores and ``arm_dynamics.ros``, the outputs and the engine, and none of the services.
"""

from arm_sim.ros.robot.all_joints import AllJointStates
from arm_sim.ros.robot.display import Display
from arm_sim.ros.robot.params import RobotParams, publish_description

__all__ = ["AllJointStates", "Display", "RobotParams", "publish_description"]
