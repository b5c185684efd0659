# SPDX-License-Identifier: Apache-2.0
"""Files of recordings: the suite's own (MCAP), bags of robots, tables.

Depends on the contents of a recording, but not on ROS: messages are serialized here. Public are
``save`` and ``load``, and the writers used by the recorder of a running system.
"""

from arm_sim.recording.files.storage import SUFFIXES, Stream, load, save
from arm_sim.recording.files.tick_writer import TickFile
from arm_sim.recording.files.writer import McapWriter, new_file

__all__ = ["SUFFIXES", "McapWriter", "Stream", "TickFile", "load", "new_file", "save"]
