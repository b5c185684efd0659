# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.trajectory_optimization``."""

from benchmarks.trajectory_optimization.cli import main

main(prog_name="python -m benchmarks.trajectory_optimization")
