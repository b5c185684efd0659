# SPDX-License-Identifier: Apache-2.0
"""What a run leaves behind: its states and commands, and where its energy came from and went.

Knows plants and ticks, which the energy account may repeat; nothing of the simulator. Files are
read and written in ``files``.
"""

from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.recording import Recording

__all__ = ["EnergyAccount", "Recording"]
