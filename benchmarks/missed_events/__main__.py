# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.missed_events``."""

from benchmarks.missed_events.cli import main

main(prog_name="python -m benchmarks.missed_events")
