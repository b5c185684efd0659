# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.record``."""

from benchmarks.record.cli import main

main(prog_name="python -m benchmarks.record")
