# SPDX-License-Identifier: Apache-2.0
"""Tangents: how a small change of the state, command or parameters grows over steps and ticks."""

from arm_sim.derivatives.tangents.functions import (
    MAX_OPERATIONS,
    TANGENTS,
    TangentFunctions,
    tangents_source,
)
from arm_sim.derivatives.tangents.tangents import Arms, Tangents

__all__ = ["MAX_OPERATIONS", "TANGENTS", "Arms", "TangentFunctions", "Tangents", "tangents_source"]
