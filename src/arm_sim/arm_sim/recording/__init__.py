# SPDX-License-Identifier: Apache-2.0
"""What a run leaves behind: its states and commands, and where its energy came from and went.

Knows plants and ticks, which the energy account may repeat, and the view, in which it is shown;
nothing of the simulator. Files are read and written in ``files``.
"""

from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.recording import Recording
from arm_sim.recording.showing import film_of

__all__ = ["EnergyAccount", "Recording", "film_of"]
