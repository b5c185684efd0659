# SPDX-License-Identifier: Apache-2.0
"""Exciting trajectories: motions within limits from which parameters can be identified.

Depends on the equations, for the regressor as an expression, and on trajectories; not on
recordings.
"""

from arm_studies.identification.excitation.room import Box, Room
from arm_studies.identification.excitation.search import Excitation, excite

__all__ = ["Box", "Excitation", "Room", "excite"]
