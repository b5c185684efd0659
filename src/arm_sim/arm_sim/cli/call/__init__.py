# SPDX-License-Identifier: Apache-2.0
"""``./arm call``: the services of running nodes, without the ros2 command line.

``asking`` has the common parts of its commands, ``questions`` the commands for a dynamics node and
``orders`` those for a sim node. The client, and ROS with it, is imported when a command runs.
"""

from arm_sim.cli.call import orders, questions
from arm_sim.cli.call.asking import call

__all__ = ["call", "orders", "questions"]
