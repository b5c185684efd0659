# SPDX-License-Identifier: Apache-2.0
"""``./arm go``, ``set``, ``get`` and ``watch``: a running arm from the shell, without ROS tools.

``listener`` joins the ROS graph, ``node_parameters`` reads and sets parameters. ROS is
imported when a command runs.
"""

from arm_sim.cli.robot.go import go
from arm_sim.cli.robot.parameters import get, set_
from arm_sim.cli.robot.watch import watch

__all__ = ["get", "go", "set_", "watch"]
