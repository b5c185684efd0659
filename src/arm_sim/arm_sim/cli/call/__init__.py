# SPDX-License-Identifier: Apache-2.0
"""``./arm call``: the services of running nodes, without the ros2 command line.

``asking`` holds what all of its commands share, ``questions`` those that ask a dynamics node and
``orders`` those that command a sim node. The client, and ROS with it, is imported when a command
asks.
"""

from arm_sim.cli.call import orders, questions
from arm_sim.cli.call.asking import call

__all__ = ["call", "orders", "questions"]
