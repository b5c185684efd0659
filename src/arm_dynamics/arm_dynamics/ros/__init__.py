# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes of the dynamics package, and what all nodes of the suite share.

A node is thin: it reads parameters, builds the core, converts and delegates; there is no
mathematics here. ``interfaces`` names all topics, services and actions of the nodes. Names are
imported when they are first used, since a client needs none of the nodes.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_dynamics.ros.common.executor import make_executor
    from arm_dynamics.ros.common.transport import LARGE_BATCHES, clear_dead
    from arm_dynamics.ros.controller_node.node import ControllerNode
    from arm_dynamics.ros.dynamics_node.node import DynamicsNode

__all__ = ["ControllerNode", "DynamicsNode", "LARGE_BATCHES", "clear_dead", "make_executor"]
__getattr__, __dir__ = on_demand(__name__, __file__)
