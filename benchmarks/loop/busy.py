# SPDX-License-Identifier: Apache-2.0
"""``python benchmarks/loop/busy.py sim SCENE``: a command in a process that builds kernels.

One after another, of a Panda with another payload each time: expressions hold the interpreter, and
the compiler takes a core. The file also runs with sources of an older tree.
"""

from __future__ import annotations

import sys
import time
from threading import Thread

from arm_dynamics import Dynamics, load_scene
from arm_sim.cli.main import main

try:
    from arm_dynamics.control import CompiledComputedTorque, preparation
except ImportError:  # an older tree
    from arm_dynamics import control_compiled

EVERY = 5.0  # [s]


def build(scene: str) -> None:
    """Build kernels of computed torque for ever."""
    plain, count = load_scene(scene).model_dump(exclude_unset=True), 0
    while True:
        time.sleep(EVERY)
        count += 1
        load = {"frame": "panda_hand", "mass": 0.1 + 1e-9 * time.time() + 1e-3 * count}
        _compile(Dynamics(plain | {"payloads": [load]}))


def _compile(dynamics: Dynamics) -> None:
    if "preparation" not in globals():
        control_compiled.build(dynamics.model)
    elif (job := preparation(CompiledComputedTorque(dynamics))) is not None:
        job()


if __name__ == "__main__":
    Thread(target=build, args=sys.argv[2:3], name="builder", daemon=True).start()
    main(sys.argv[1:], prog_name="./arm")
