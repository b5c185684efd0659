# SPDX-License-Identifier: Apache-2.0
"""The robot's description, its publication, and parameters of visualization topics."""

from __future__ import annotations

from dataclasses import dataclass

from rclpy.node import Node
from std_msgs.msg import String

from arm_dynamics.ros.common.direct import advertise
from arm_dynamics.ros.common.params import parameter
from arm_dynamics.ros.common.robot_source import FROM_TOPIC, DescriptionParams
from arm_dynamics.ros.interfaces import ROBOT_DESCRIPTION


@dataclass(frozen=True)
class RobotParams(DescriptionParams):
    """Parameters of the topics that describe the robot."""

    publish_description: bool = parameter(
        True, "Publish the URDF on robot_description, unless it came from there"
    )
    publish_all_joints: bool = parameter(
        False, "Include locked and mimic joints in joint_states, not only in ~/all_joint_states"
    )
    publish_tf: bool = parameter(
        True, "Publish /tf and /tf_static, while no robot_state_publisher does; needs tf2_msgs"
    )
    frame_prefix: str = parameter("", "Prefix of every frame name on /tf, such as left/")
    frame_id: str = parameter("", "frame_id of the joint states")
    display_rate: float = parameter(
        50.0, "Messages per second on /tf and ~/all_joint_states; 0: none", low=0.0, high=1000.0
    )


def publish_description(node: Node, params: RobotParams, urdf: str, source: str) -> None:
    """Publish the description once (latched), unless it came from that topic."""
    if params.publish_description and source != FROM_TOPIC:
        advertise(node, ROBOT_DESCRIPTION).publish(String(data=urdf))
