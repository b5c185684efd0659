# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of ticks and rollouts, across the events in them.

Smooth motion is differentiated in compiled code; events add their own derivatives. Depends on
plants, methods and ticks, not on their users.
"""

from arm_sim.derivatives.derivatives import Derivatives
from arm_sim.derivatives.gradient import Gradients, RolloutGradient
from arm_sim.derivatives.linearization import Linearizer

__all__ = ["Derivatives", "Gradients", "Linearizer", "RolloutGradient"]
