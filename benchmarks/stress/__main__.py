# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.stress``."""

from benchmarks.stress.cli import main

# Worker processes import this module too.
if __name__ == "__main__":
    main(prog_name="./arm stress")
