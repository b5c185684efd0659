# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.following``."""

from benchmarks.following.cli import main

main(prog_name="python -m benchmarks.following")
