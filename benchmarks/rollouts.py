# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.rollouts``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np

from arm_dynamics import load_scene
from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.stepping.lanes import natural_width
from benchmarks.measurement.intervals import of_median
from benchmarks.measurement.timing import Noise, cpu, interleaved
from benchmarks.reporting.markdown import table

ARMS, TICKS = 64, 200
BRISTLES = {"sigma0": 1e5, "sigma1": 316, "sigma1_velocity": 0.02}
DRY = {"coulomb": 1.0, "static": 1.5, "stribeck_velocity": 0.01, "viscous": 0.4}
MOTOR = {"resistance": 1.0, "inductance": 1e-3, "torque_constant": 0.05, "rotor_inertia": 5e-5,
         "gear_ratio": 100, "command": "voltage"}  # fmt: skip
BELT = {"stiffness": 5000, "damping": 1.0}
FEATURES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "rigid, RK4": ({}, {}),
    "rigid, error control to 1e-9": ({}, {"tolerance": 1e-9}),
    "motors with windings": ({"actuator": MOTOR}, {}),
    "motors and flexible joints": ({"actuator": MOTOR, "transmission": BELT}, {}),
    "LuGre friction": ({"friction": DRY | {"lugre": BRISTLES}}, {}),
    "LuGre friction, motors": (
        {"friction": DRY | {"lugre": BRISTLES}, "actuator": MOTOR}, {},
    ),
    "dry friction": ({"friction": DRY}, {}),
    "Coulomb friction": ({"friction": {"coulomb": 1.0}}, {}),
    "pressed onto a table": ({"friction": {"viscous": 2.0}}, {"scene": "panda_table"}),
}  # fmt: skip
"""Of every joint of a Panda, and options of its simulator; ``scene``: another scene of it."""
FORCE = 30.0  # of a hand that is pressed onto a table [N]


@click.command()
@click.option("--repeats", default=12, show_default=True, help="Rounds.")
@click.option("--out", default=Path("reports/rollouts.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(repeats: int, out: Path) -> None:
    """Time ticks of many Pandas with features on one core, one by one and in vector registers."""
    noise, results = Noise(), {}
    for name, (joint, options) in FEATURES.items():
        alone, together = (_rollout(joint, options, lanes) for lanes in (1, natural_width()))
        if not np.array_equal(alone(), together(), equal_nan=True):
            raise click.ClickException(f"{name}: the motions differ")
        jobs = {"alone": lambda c=alone: cpu(c), "together": lambda c=together: cpu(c)}
        costs = interleaved(jobs, repeats, noise, lambda: None)
        ratio = np.divide(*(costs[which].samples for which in jobs))
        tick = {which: 1e6 * cost.median / (ARMS * TICKS) for which, cost in costs.items()}
        results[name] = tick | {
            "ratio": float(np.median(ratio)),
            "interval": of_median(ratio.tolist()),
        }
        click.echo(f"{name}: {tick}", err=True)
    head = (
        "every joint of a Panda",
        "one by one [µs]",
        "in registers [µs]",
        "ratio",
        "95 % interval",
    )
    click.echo(table(head, _rows(results)))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps({"ticks": results, "machine": noise.summary()}, indent=1))


def _rollout(joint: dict[str, Any], options: dict[str, Any], lanes: int) -> Any:
    """A rollout of arms with various starts; commands change four times."""
    own, options = options.get("scene"), {k: v for k, v in options.items() if k != "scene"}
    scene = load_scene(own or "panda").model_dump(exclude_unset=True)
    scene["joints"] = {"*": joint | {"limits": {"stop": False}}}
    sim, rng = Simulator(scene, **options), np.random.default_rng(0)
    wide = 0.2 if own else 1.0  # a hand above a table starts close to it
    q0 = sim.model.q0 + 0.1 * wide * rng.normal(size=(ARMS, sim.n))
    v0 = 0.3 * wide * rng.normal(size=(ARMS, sim.n))
    held = sim.dynamics.gravity(sim.model.q0) + 5.0 * wide * rng.normal(size=(ARMS, 4, sim.n))
    if own:
        held -= FORCE * TaskSpace(sim.dynamics, "panda_hand").jacobian(sim.model.q0)[2]
    tau = np.repeat(held, TICKS // 4, axis=1)
    return lambda: sim.rollout(q0, v0, tau, TICKS, threads=1, lanes=lanes)


def _rows(results: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    for name, one in results.items():
        low, high = one["interval"]
        yield (name, f"{one['alone']:.2f}", f"{one['together']:.2f}", f"{one['ratio']:.1f}",
               f"{low:.1f} – {high:.1f}")  # fmt: skip


main(prog_name="python -m benchmarks.rollouts")
