# SPDX-License-Identifier: Apache-2.0
"""Random sets of features on ordinary arms: is a wrong motion ever not told? Also by MuJoCo."""

from benchmarks.stress.together import tables
from benchmarks.stress.together.apart import survey
from benchmarks.stress.together.judge import FORBIDDEN, MUJOCO, OURS, OUTCOMES, Result
from benchmarks.stress.together.page import write

__all__ = ["FORBIDDEN", "MUJOCO", "OURS", "OUTCOMES", "Result", "survey", "tables", "write"]
