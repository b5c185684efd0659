# SPDX-License-Identifier: Apache-2.0
"""The longest tick of a Panda that is thrown about: stops, friction and contacts at once.

Random torques of 30 N m, changed every 20 ms, drive it against its stops and a table for three
seconds, RK4 at 1 ms. Each tick is timed in three equal runs, of which the shortest counts: what
the host takes away is not the engine's. ``./arm python -m benchmarks.studies.storm`` prints the
table of docs/laboratory/feature-costs.md.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from arm_dynamics import load_scene
from arm_sim import Simulator

TICKS, CHANGE, TORQUE, RUNS = 3000, 20, 30.0, 3
TABLE, RING, TIP = 0.3, 0.06, 0.1
"""Height of the table, radius of the ring of points on the hand, their offset from it, in [m]."""
BOUNCING: dict[str, Any] = {"limits": {"stop": {"restitution": 0.7}}}
STRIBECK = {"friction": {"coulomb": 2.0, "static": 3.0, "stribeck_velocity": 0.05}}
DRY = {"friction": {"coulomb": 1.0, "static": 1.5}}


def points(count: int) -> list[dict[str, Any]]:
    """Contacts in a ring on the hand, every other one with restitution 0.3."""
    around = np.arange(count) * 2.0 * np.pi / count
    return [
        {
            "type": "contact", "name": f"c{k}", "frame": "panda_hand",
            "point": [RING * np.cos(a), RING * np.sin(a), TIP],
            "plane": {"point": [0, 0, TABLE]},
            "friction": 0.4, "static_friction": 0.5, "restitution": 0.3 * (k % 2),
        }
        for k, a in enumerate(around)
    ]  # fmt: skip


def scenes() -> dict[str, dict[str, Any]]:
    """What is thrown about."""
    panda = load_scene("panda").model_dump(exclude_unset=True)
    return {
        "stops": panda,
        "stops with restitution 0.7": panda | {"joints": {"*": BOUNCING}},
        "stops, Stribeck friction": panda | {"joints": {"*": STRIBECK}},
        "stops, 1 contact": panda | {"constraints": points(1)},
        "stops, 4 contacts": panda | {"constraints": points(4)},
        "stops, 4 contacts, dry friction": panda
        | {"constraints": points(4), "joints": {"*": DRY}},
        "stops, 8 contacts": panda | {"constraints": points(8)},
        "stops, 8 contacts, dry friction": panda
        | {"constraints": points(8), "joints": {"*": DRY}},
    }


def ticks(sim: Simulator) -> np.ndarray:
    """Processor time of each tick of a storm in [s]."""
    draw, taken = np.random.default_rng(1), np.empty(TICKS)
    bound = sim.model.effort_limit
    sim.reset()
    for k in range(TICKS):
        if k % CHANGE == 0:
            torque = np.clip(draw.normal(0.0, TORQUE, sim.n), -bound, bound)
        began = time.thread_time()
        sim.arm.advance(torque)
        taken[k] = time.thread_time() - began
    return taken


def main() -> None:
    """Print the table."""
    print("| scene | median [µs] | 99 % [µs] | worst [µs] | blows | ticks time-stepped |")
    print("|---|---|---|---|---|---|")
    for name, scene in scenes().items():
        sim = Simulator(scene, integrator="rk4", dt=1e-3)
        taken = 1e6 * np.min([ticks(sim) for _ in range(RUNS)], axis=0)
        median, high, worst = np.quantile(taken, [0.5, 0.99, 1.0])
        state = sim.state
        print(f"| {name} | {median:.1f} | {high:.0f} | {worst:.0f} | {sim.impacts} "
              f"| {state.time_stepped} of {TICKS} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
