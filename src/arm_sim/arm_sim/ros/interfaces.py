# SPDX-License-Identifier: Apache-2.0
"""Topics of the sim node; those it shares with other nodes are in ``arm_dynamics.ros``."""

from arm_msgs.msg import Energy, Multipliers
from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from arm_dynamics.ros.interfaces import NEWEST, Topic

COMMANDS = Topic("~/commands", Float64MultiArray, subscribe=NEWEST)
GROUND_TRUTH = Topic("~/ground_truth", JointState)  # if joint_states are measurements
ENERGY = Topic("~/energy", Energy)
MULTIPLIERS = Topic("~/multipliers", Multipliers)
CLOCK = Topic("/clock", Clock)  # where use_sim_time listens, in any namespace
WRENCH = Topic("~/wrench", WrenchStamped)
ALL_JOINT_STATES = Topic("~/all_joint_states", JointState)
