# SPDX-License-Identifier: Apache-2.0
"""Ordinary ticks of the sim node in C: without Python, and without the interpreter lock.

Most ticks are like those before: a command of the one controller has come, the arm moves, and its
state is published and recorded. Those are made here. Whatever is out of the ordinary is left,
untouched, to the engine, which alone decides on it: so there is one set of rules. Knows the parts
of the node; only the node knows it.
"""

from arm_sim.ros.ordinary.ticks import OrdinaryTicks

__all__ = ["OrdinaryTicks"]
