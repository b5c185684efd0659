# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node that simulates an arm, and its parts.

``tick_engine`` and the modules it uses (``commands``, ``tick_queue``) do not depend on ROS; the
other modules connect the engine to topics, services, diagnostics and the clock. The folder may use
the cores and ``arm_dynamics.ros``, not the command line. Public is ``SimNode``.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_sim.ros.sim_node.node import SimNode

__all__ = ["SimNode"]
__getattr__, __dir__ = on_demand(__name__, __file__)
