# SPDX-License-Identifier: Apache-2.0
"""``./arm demo``: the control loop of an arm in three processes.

``course`` plans, starts, monitors, stops and reports; ROS and plotting are imported when the
``command`` runs.
"""

from arm_sim.cli.demo.command import demo

__all__ = ["demo"]
