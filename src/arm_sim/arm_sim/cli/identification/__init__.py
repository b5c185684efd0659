# SPDX-License-Identifier: Apache-2.0
"""Commands that identify the parameters of a scene from measured motions."""

from arm_sim.cli.identification.compare import compare
from arm_sim.cli.identification.excite import excite
from arm_sim.cli.identification.identify import identify
from arm_sim.cli.identification.identify_drive import identify_drive

__all__ = ["compare", "excite", "identify", "identify_drive"]
