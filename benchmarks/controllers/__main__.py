# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.controllers``."""

from benchmarks.controllers.cli import main

main(prog_name="./arm compare-controllers")
