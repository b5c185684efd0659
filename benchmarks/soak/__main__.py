# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.soak``."""

from benchmarks.soak.cli import main

main(prog_name="./arm soak")
