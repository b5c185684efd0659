# SPDX-License-Identifier: Apache-2.0
"""Ordinary ticks of the sim node in C: without Python, and without the interpreter lock.

Most ticks are alike: a command of the only controller has arrived, the arm moves, and its state is
published and recorded. These are executed here. All other cases are left unchanged to the engine,
which alone decides on them; the rules that both follow are in ``native/loop.c`` of the node.
Depends on the parts of the node; only the node depends on it.
"""

from arm_sim.ros.ordinary.ticks import OrdinaryTicks

__all__ = ["OrdinaryTicks"]
