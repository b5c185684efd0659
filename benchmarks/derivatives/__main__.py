# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.derivatives``."""

from benchmarks.derivatives.cli import main

main(prog_name="python -m benchmarks.derivatives")
