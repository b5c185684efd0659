# SPDX-License-Identifier: Apache-2.0
"""Recordings of runs: states, commands, their error and the energy account.

Depends on plants and ticks, which a second run and the energy account repeat; not on the
simulator. Files are read and written in ``files``.
"""

from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.motion import RecordedMotion
from arm_sim.recording.recording import Recording

__all__ = ["EnergyAccount", "RecordedMotion", "Recording"]
