# SPDX-License-Identifier: Apache-2.0
"""Topics of the sim node; those it shares with other nodes are in ``arm_dynamics.ros``."""

from __future__ import annotations

from arm_msgs.msg import Energy, Multipliers
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from arm_dynamics.ros.interfaces import LATCHED, NEWEST, Topic

COMMANDS = Topic("~/commands", Float64MultiArray, subscribe=NEWEST)
GROUND_TRUTH = Topic("~/ground_truth", JointState)  # if joint_states are measurements
ENERGY = Topic("~/energy", Energy)
MULTIPLIERS = Topic("~/multipliers", Multipliers)
CLOCK = Topic("/clock", Clock)  # where use_sim_time listens, in any namespace
WRENCH = Topic("~/wrench", WrenchStamped)
ALL_JOINT_STATES = Topic("~/all_joint_states", JointState)


def frames_topics() -> tuple[Topic, Topic] | None:
    """Topics of moving and of fixed frames; None without tf2_msgs."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return None
    moving = Topic("/tf", TFMessage, publish=QoSProfile(depth=100))
    return moving, Topic("/tf_static", TFMessage, publish=LATCHED)
