# SPDX-License-Identifier: Apache-2.0
"""Recordings of runs: states, commands and the energy account.

Depends on plants and ticks, which the energy account may repeat, and on the view, in which a
recording is shown; not on the simulator. Files are read and written in ``files``.
"""

from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.recording import Recording
from arm_sim.recording.showing import film_of

__all__ = ["EnergyAccount", "Recording", "film_of"]
