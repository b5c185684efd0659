# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks``."""

from benchmarks.comparison.cli import main

main(prog_name="python -m benchmarks")
