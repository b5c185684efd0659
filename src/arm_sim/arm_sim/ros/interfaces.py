# SPDX-License-Identifier: Apache-2.0
"""Names, types and qualities of service of what the sim node says and hears, in one place."""

from __future__ import annotations

from arm_msgs.msg import Energy, Multipliers
from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from arm_dynamics.ros.interfaces import (
    JOINT_COMMANDS,
    JOINT_STATES,
    NEWEST,
    PAUSE,
    RESET,
    RESET_COUNTERS,
    SET_FRICTION,
    SET_JOINT_STATE,
    SET_PAYLOAD,
    SOURCES,
    STEP,
    Topic,
)

__all__ = [
    "CLOCK",
    "COMMANDS",
    "ENERGY",
    "JOINT_COMMANDS",
    "JOINT_STATES",
    "MAX_COMMANDS",
    "MAX_STEPS",
    "MULTIPLIERS",
    "PAUSE",
    "RESET",
    "RESET_COUNTERS",
    "SET_FRICTION",
    "SET_JOINT_STATE",
    "SET_PAYLOAD",
    "STEP",
    "WRENCH",
]

MAX_STEPS = 10_000  # of one service call
MAX_COMMANDS = SOURCES.depth  # looked at in one tick

COMMANDS = Topic("~/commands", Float64MultiArray, subscribe=NEWEST)
ENERGY = Topic("~/energy", Energy)
MULTIPLIERS = Topic("~/multipliers", Multipliers)
CLOCK = Topic("clock", Clock)
WRENCH = Topic("~/wrench", WrenchStamped)
