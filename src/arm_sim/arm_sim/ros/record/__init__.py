# SPDX-License-Identifier: Apache-2.0
"""Recordings of running systems: every tick of a sim node, or the messages of any topics.

Knows the engine and its topics, and how recordings are written; a thread of its own compresses and
writes. Public is what the sim node needs.
"""

from arm_sim.ros.record.copying import SOURCE as RECORD
from arm_sim.ros.record.node import listen, recorder_of
from arm_sim.ros.record.ticks import TickRecorder

__all__ = ["RECORD", "TickRecorder", "listen", "recorder_of"]
