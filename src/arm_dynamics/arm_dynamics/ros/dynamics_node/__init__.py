# SPDX-License-Identifier: Apache-2.0
"""The executable of the dynamics node, which answers inverse and forward dynamics as services.

``main`` begins at once: the node is imported later.
"""

import sys
from typing import TYPE_CHECKING, NoReturn

from arm_dynamics.lazy import on_demand
from arm_dynamics.starting import end_when_interrupted

if TYPE_CHECKING:
    from arm_dynamics.ros.dynamics_node.node import DynamicsNode, DynamicsParams

__all__ = ["DynamicsNode", "DynamicsParams", "main"]
__getattr__, __dir__ = on_demand(__name__, __file__)


def main(args: list[str] | None = None) -> NoReturn:
    """Run the node until it is interrupted, and end the program with its status."""
    end_when_interrupted()
    from arm_dynamics.ros.common.executable import execute
    from arm_dynamics.ros.dynamics_node.node import DynamicsNode, DynamicsParams

    sys.exit(execute(DynamicsNode, DynamicsParams, args))
