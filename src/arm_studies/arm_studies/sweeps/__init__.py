# SPDX-License-Identifier: Apache-2.0
"""Sweeps: many closed-loop simulations of one arm or several, and a table of their results.

Depends on simulators and controllers, not on ROS; joblib, Dask and pyarrow are imported only where
required. Public are ``sweep``, its arguments and its results.
"""

import arm_dynamics.scene  # noqa: F401 - refuses an old pydantic before it is used
from arm_studies.sweeps.metrics import METRICS
from arm_studies.sweeps.study import ControllerChoice, MotionChoice, Study, Varied, load_study
from arm_studies.sweeps.sweep import Plan, Progress, Sweep, sweep

__all__ = [
    "METRICS", "ControllerChoice", "MotionChoice", "Plan", "Progress", "Study", "Sweep",
    "Varied", "load_study", "sweep",
]  # fmt: skip
