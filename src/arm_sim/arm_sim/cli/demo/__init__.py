# SPDX-License-Identifier: Apache-2.0
"""``./arm demo``: the whole loop on a real arm, in three processes."""

from arm_sim.cli.demo.command import demo

__all__ = ["demo"]
