# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node that simulates an arm, and what it is made of.

``tick_engine`` and what it uses (``commands``, ``tick_queue``) know no ROS; the
other modules connect the engine to topics, services, diagnostics and the clock. The folder may use
the cores and ``arm_dynamics.ros``, not the command line. Public is ``SimNode``.
"""

from arm_sim.ros.sim_node import SimNode

__all__ = ["SimNode"]
