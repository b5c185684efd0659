# SPDX-License-Identifier: Apache-2.0
"""Recordings of running systems: every tick of a sim node, or the messages of any topics.

Depends on the engine, its topics, and the writers of recordings; a separate thread compresses and
writes. Public are the parts that the sim node uses.
"""

from arm_sim.ros.record.node_recorder import recorder_of
from arm_sim.ros.record.ticks import TickRecorder

__all__ = ["TickRecorder", "recorder_of"]
