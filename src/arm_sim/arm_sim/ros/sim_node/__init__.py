# SPDX-License-Identifier: Apache-2.0
"""The sim node, which simulates an arm, and its executable.

The node is imported when it is first used, so that ``main`` begins at once.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand
from arm_dynamics.starting import end_when_interrupted

if TYPE_CHECKING:
    from arm_sim.ros.sim_node.node import SimNode

__all__ = ["SimNode", "main"]
__getattr__, __dir__ = on_demand(__name__, {"node": ("SimNode",)})


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    end_when_interrupted()
    from arm_dynamics.ros.common.background import take_short_turns
    from arm_dynamics.ros.common.executable import execute
    from arm_sim.ros.sim_node.node import SimNode
    from arm_sim.ros.sim_params import SimParams

    take_short_turns()
    sys.exit(execute(SimNode, SimParams, args))
