# SPDX-License-Identifier: Apache-2.0
"""What lies between an arm and who controls it: sensors, and lines that delay and lose.

Knows numbers, ticks and what a scene says of sensors and lines; knows no equation of motion and no
ROS. A scene without the keys ``sensors`` and ``commands`` builds nothing of it.
"""

from arm_sim.imperfections.lines import Line, command_line, delivered
from arm_sim.imperfections.sensors import Measured, Sensors, sensors_of

__all__ = ["Line", "Measured", "Sensors", "command_line", "delivered", "sensors_of"]
