# SPDX-License-Identifier: Apache-2.0
"""Which command acts: arbitrated between sources, the latest kept until it is too old.

The folder knows no ROS and nothing else of the node.
"""

from arm_sim.ros.commands.arbiter import Arbiter
from arm_sim.ros.commands.latest import LatestCommand

__all__ = ["Arbiter", "LatestCommand"]
