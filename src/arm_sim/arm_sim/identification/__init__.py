# SPDX-License-Identifier: Apache-2.0
"""Comparison of a scene with measurements.

Depends on simulators, recordings and ``arm_dynamics.identification``; not on ROS. Public is
``compare``.
"""

from arm_sim.identification.comparison import Comparison, FreeRun, compare

__all__ = ["Comparison", "FreeRun", "compare"]
