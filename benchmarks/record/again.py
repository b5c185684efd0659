# SPDX-License-Identifier: Apache-2.0
"""A long closed loop with contact, dry friction, a new load and pushes, recorded and replayed."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import load_scene
from arm_dynamics.scene import Payload, Scene
from arm_sim import Simulator
from arm_sim.ros.record.ticks import TickRecorder
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.simulation.runtime_changes import payload_change

FRICTION = {"coulomb": 0.4, "static": 0.6, "stribeck_velocity": 0.02, "viscous": 0.5}
LOAD = [2e-3, 0.0, 0.0, 2e-3, 0.0, 2e-3]
KP, KD = 150.0, 15.0  # [N m/rad], [N m s/rad]
Record = dict[str, Any]


def scene() -> Scene:
    """A Panda with dry friction and a load, above a table."""
    made = load_scene("panda_table").model_dump(exclude_unset=True)
    made["joints"] = {"*": {"friction": FRICTION}}
    made["payloads"] = [Payload(frame="panda_hand", mass=0.5, inertia=tuple(LOAD)).model_dump()]
    return load_scene(made | {"tunable": ["payload"]})


def record(seconds: float, path: Path) -> Record:
    """Press on a table and swing for a while; what was met on the way."""
    simulator = Simulator(scene())
    engine = TickEngine(simulator, wrench_timeout=0.2, wrench_reference="local_world_aligned")
    recorder = TickRecorder(path, engine)
    q0, rates = simulator.model.q0.copy(), np.array([0.7, 0.9, 0.5, 1.1, 0.6, 0.8, 1.3])
    ticks, began = round(seconds / simulator.dt), time.monotonic()
    touched = 0
    for k in range(ticks):
        if k == ticks // 3:
            load = payload_change(simulator, 0, 1.5, [0.0, 0.0, 0.1], LOAD)
            engine.change(load)
        if k in (ticks // 4, ticks // 2):
            engine.push("panda_hand", [8.0, -5.0, 3.0, 0.0, 0.0, 0.0])
        state = simulator.state
        aim = q0 + 0.25 * np.sin(rates * state.time)
        aim[3] -= 0.25  # towards the table
        torque = simulator.dynamics.gravity(state.q) + KP * (aim - state.q) - KD * state.v
        engine.commands.put(tuple(torque.tolist()))
        engine.tick()
        if k % 100 == 0:
            touched += simulator.contact_forces()[0].state != "apart"
    recorder.close()
    return {
        "ticks": recorder.ticks, "lost": recorder.lost, "impacts": simulator.impacts,
        "looks that found contact": touched / (ticks / 100),
        "run in [s]": time.monotonic() - began,
    }  # fmt: skip


def replay(path: Path) -> Record:
    """Replay in another process and another folder."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-P", "-m", "arm_sim.cli", "replay", str(path)],
            cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
    last = done.stdout.strip().splitlines()[-1:] or done.stderr.strip().splitlines()[-1:]
    return {"equal": done.returncode == 0, "said": " ".join(last),
            "replayed in [s]": time.monotonic() - began}  # fmt: skip
