# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes of the dynamics package, and what every node of the suite shares.

A node is thin: it reads parameters, builds the core, converts and delegates; there is no
mathematics here. ``interfaces`` names everything the nodes say and hear. Names are looked up at
first use, since a client needs none of the nodes.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arm_dynamics.ros.common.executor import make_executor
    from arm_dynamics.ros.common.transport import clear_dead
    from arm_dynamics.ros.controller_node import ControllerNode
    from arm_dynamics.ros.dynamics_node import DynamicsNode

__all__ = ["ControllerNode", "DynamicsNode", "clear_dead", "make_executor"]
_HOMES = {
    "ControllerNode": "controller_node",
    "DynamicsNode": "dynamics_node",
    "clear_dead": "common.transport",
    "make_executor": "common.executor",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    return globals()[name]
