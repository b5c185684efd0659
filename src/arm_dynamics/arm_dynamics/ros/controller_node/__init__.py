# SPDX-License-Identifier: Apache-2.0
"""The executable of the controller node, which moves an arm along trajectories.

``main`` begins at once: the node is imported later.
"""

import sys
from typing import TYPE_CHECKING, NoReturn

from arm_dynamics.lazy import on_demand
from arm_dynamics.starting import end_when_interrupted

if TYPE_CHECKING:
    from arm_dynamics.ros.controller_node.node import ControllerNode

__all__ = ["ControllerNode", "main"]
__getattr__, __dir__ = on_demand(__name__, __file__)


def main(args: list[str] | None = None) -> NoReturn:
    """Run the node until it is interrupted, and end the program with its status."""
    end_when_interrupted()
    from arm_dynamics.ros.common.executable import execute
    from arm_dynamics.ros.controller.controller_params import ControllerParams
    from arm_dynamics.ros.controller_node.node import ControllerNode

    sys.exit(execute(ControllerNode, ControllerParams, args, own_thread=True))
