# SPDX-License-Identifier: Apache-2.0
"""Imperfections between an arm and its controller: sensors, delays and lost messages.

Depends on numbers, ticks and the keys of the scene for sensors and lines, and on no equation of
motion and no ROS. For a scene without the keys ``sensors`` and ``commands`` nothing is built.
"""

from arm_sim.imperfections.lines import Line, command_line, delivered
from arm_sim.imperfections.sensors import Measured, Sensors, sensors_of

__all__ = ["Line", "Measured", "Sensors", "command_line", "delivered", "sensors_of"]
