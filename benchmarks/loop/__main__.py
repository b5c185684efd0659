# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.loop``."""

from benchmarks.loop.cli import main

main(prog_name="./arm bench loop")
