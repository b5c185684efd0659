# SPDX-License-Identifier: Apache-2.0
"""Pushes from outside, as messages."""

from geometry_msgs.msg import WrenchStamped


def pushed(frame: str, *values: float) -> WrenchStamped:
    """A push on a frame: three numbers of the force, then three of the torque."""
    message = WrenchStamped()
    message.header.frame_id = frame
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = values
    return message
