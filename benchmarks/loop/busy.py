# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.loop.busy``: a command of the suite in a process that builds kernels.

One after another, of a Panda with another payload each time: expressions hold the interpreter, and
the compiler takes a core.
"""

from __future__ import annotations

import sys
import time
from threading import Thread

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.control import CompiledComputedTorque, preparation
from arm_sim.cli.main import main

EVERY = 5.0  # [s]


def build() -> None:
    """Build kernels for ever."""
    plain, count = load_scene("panda").model_dump(exclude_unset=True), 0
    while True:
        time.sleep(EVERY)
        count += 1
        load = {"frame": "panda_hand", "mass": 0.1 + 1e-9 * time.time() + 1e-3 * count}
        job = preparation(CompiledComputedTorque(Dynamics(plain | {"payloads": [load]})))
        if job is not None:
            job()


if __name__ == "__main__":
    Thread(target=build, name="builder", daemon=True).start()
    main(sys.argv[1:], prog_name="./arm")
