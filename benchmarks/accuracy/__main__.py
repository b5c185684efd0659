# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.accuracy``."""

from benchmarks.accuracy.cli import main

main(prog_name="python -m benchmarks.accuracy")
