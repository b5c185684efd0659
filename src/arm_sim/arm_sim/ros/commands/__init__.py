# SPDX-License-Identifier: Apache-2.0
"""Which command acts: put together by joints, arbitrated between sources, kept until too old.

And how the arm is stopped and held when none does. The folder knows no messages and no topics, and
nothing else of the node.
"""

from arm_sim.ros.commands.arbiter import Arbiter
from arm_sim.ros.commands.latest import LatestCommand

__all__ = ["Arbiter", "LatestCommand"]
