# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.sweeps``."""

from benchmarks.sweeps.cli import main

main(prog_name="python -m benchmarks.sweeps")
