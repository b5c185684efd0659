# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.matrix``."""

from benchmarks.matrix.cli import main

main(prog_name="python -m benchmarks.matrix")
