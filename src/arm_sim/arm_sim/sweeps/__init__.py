# SPDX-License-Identifier: Apache-2.0
"""Sweeps: many closed loops of one arm or several, and what came out of each as a table.

Knows simulators, controllers and what a study says; of libraries it asks for joblib, Dask and
pyarrow only where they are needed, and it knows no ROS. Public is ``sweep`` with what it takes and
gives.
"""

from arm_sim.sweeps.metrics import METRICS
from arm_sim.sweeps.study import ControllerChoice, MotionChoice, Study, Varied, load_study
from arm_sim.sweeps.sweep import Plan, Progress, Sweep, sweep

__all__ = [
    "METRICS", "ControllerChoice", "MotionChoice", "Plan", "Progress", "Study", "Sweep",
    "Varied", "load_study", "sweep",
]  # fmt: skip
