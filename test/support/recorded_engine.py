# SPDX-License-Identifier: Apache-2.0
"""An engine to be recorded, a motion in which everything happens to it, and what is in a file."""

from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader

import models
from arm_sim import Simulator
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.simulation.runtime_changes import payload_change

CONTACT = {
    "type": "contact", "frame": "forearm", "point": [0.5, 0.0, 0.0],
    "plane": {"frame": "world", "point": [0.0, 0.0, -0.6]}, "friction": 0.4,
}  # fmt: skip


def scene(**more: Any) -> dict[str, Any]:
    """An arm with dry friction and a load that may be changed, above a table."""
    made = models.scene("two_link").model_dump(exclude_unset=True)
    made["joints"] = {"*": {"friction": {"coulomb": 0.1, "static": 0.15, "viscous": 0.1}}}
    made["payloads"] = [{"frame": "forearm", "mass": 0.3, "inertia": [1e-3, 0, 0, 1e-3, 0, 1e-3]}]
    return made | {"tunable": ["payload"], "constraints": [CONTACT]} | more


def engine_of(made: Any, **options: Any) -> TickEngine:
    simulator = Simulator(made, **options)
    return TickEngine(simulator, wrench_timeout=0.05, wrench_reference="local")


def run(engine: TickEngine, ticks: int) -> None:
    for _ in range(ticks):
        state = engine.simulator.state
        engine.commands.put(tuple((2.0 * np.sin([3 * state.time, 5 * state.time])).tolist()))
        engine.tick()


def busy(engine: TickEngine) -> list[np.ndarray]:
    """A motion with everything that may happen to it; the states after each tick."""
    states: list[np.ndarray] = []
    engine.on.tick.append(lambda: states.append(engine.simulator.arm.x.copy()))
    run(engine, 300)
    load = payload_change(engine.simulator, 0, 0.8, [0.0, 0.0, 0.1], [2e-3, 0, 0, 2e-3, 0, 2e-3])
    engine.change(load)
    run(engine, 100)
    engine.push("forearm", [3.0, 0.0, -4.0, 0.0, 0.0, 0.0])
    run(engine, 200)
    engine.change(lambda: engine.simulator.set_state([0.4, -0.3], [0.0, 0.5]))
    run(engine, 100)
    engine.reset()
    run(engine, 150)
    return states


def contents(path: Path) -> dict[str, list[bytes]]:
    """Messages of a file by topic."""
    found: dict[str, list[bytes]] = {}
    with path.open("rb") as file:
        for _, channel, told in make_reader(file).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append(told.data)
    return found
