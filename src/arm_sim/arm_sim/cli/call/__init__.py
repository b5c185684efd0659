# SPDX-License-Identifier: Apache-2.0
"""``./arm call``: the services of running nodes, without the ros2 command line.

``services`` has the table of the commands and reads the service files, ``commands`` makes options
of the fields of a request, and ``answers`` prints those of a response. ROS is imported when a
command runs.
"""

from arm_sim.cli.call.commands import call

__all__ = ["call"]
