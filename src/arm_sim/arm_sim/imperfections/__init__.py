# SPDX-License-Identifier: Apache-2.0
"""Imperfections between an arm and its controller: sensors, delays and lost messages.

Depends on the scene's keys for sensors and commands, but not on the equations of motion or ROS. A
scene without the keys ``sensors`` and ``commands`` has none of them.
"""

from arm_sim.imperfections.lines import Line, command_line, delivered
from arm_sim.imperfections.sensors import Measured, Sensors, sensors_of

__all__ = ["Line", "Measured", "Sensors", "command_line", "delivered", "sensors_of"]
