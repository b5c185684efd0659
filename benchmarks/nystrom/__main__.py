# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.nystrom``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import numpy as np

from arm_dynamics import load_scene
from arm_sim import Simulator
from benchmarks.measurement.intervals import of_median
from benchmarks.measurement.timing import Noise, cpu, interleaved
from benchmarks.reporting.markdown import table

METHODS = ("rk4", "nystrom4")
STEPS = (1e-3, 2e-3, 4e-3)
DURATION, STARTS, TICKS = 1.0, 32, 2000
FREE = {"friction": {"viscous": 0}, "limits": {"effort": 1e9, "stop": False}}
SCENES = {
    "Panda": ("panda", FREE),
    "UR10": ("ur10", FREE),
    "Panda with viscous friction of 0.5": ("panda", FREE | {"friction": {"viscous": 0.5}}),
    "Panda with dry friction": ("panda", FREE | {"friction": {"coulomb": 1.0, "viscous": 0.5}}),
}


@click.command()
@click.option("--repeats", default=40, show_default=True, help="Rounds.")
@click.option("--out", default=Path("reports/nystrom.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(repeats: int, out: Path) -> None:
    """Compare free motions of a second with an integration to 1e-13, and time ticks in turn.

    Errors are those from the initial position; their ratio is the geometric mean over many starts.
    """
    noise = Noise()
    told = {name: _measured(_scene(*how), repeats, noise) for name, how in SCENES.items()}
    heads = [f"{method}, {1e3 * dt:g} ms [rad]" for dt in STEPS for method in METHODS]
    heads += ["errors of many", "time", "95 % interval"]
    click.echo(table(("arm", *heads), map(_row, told.items())))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps({"arms": told, "machine": noise.summary()}, indent=1))


def _scene(name: str, joints: dict[str, Any]) -> Any:
    scene = load_scene(name).model_dump(exclude_unset=True)
    return load_scene(scene | {"joints": {"*": joints}})


def _measured(scene: Any, repeats: int, noise: Noise) -> dict[str, Any]:
    exact = _ends(Simulator(scene, integrator="dop853", tolerance=1e-13, dt=1e-2))
    errors = {
        method: [
            abs(_ends(Simulator(scene, integrator=method, dt=dt)) - exact).max(axis=1)
            for dt in STEPS
        ]
        for method in METHODS
    }
    jobs = {method: _job(Simulator(scene, integrator=method)) for method in METHODS}
    costs = interleaved(jobs, repeats, noise, lambda: None)
    rk4, nystrom4 = (errors[method][0] for method in METHODS)
    time = np.divide(*(costs[method].samples for method in reversed(METHODS)))
    return {
        "errors": {method: [float(e[0]) for e in found] for method, found in errors.items()},
        "error ratio": float(np.exp(np.mean(np.log(nystrom4 / rk4)))),
        "ns": {method: 1e9 * cost.median / TICKS for method, cost in costs.items()},
        "time ratio": float(np.median(time)),
        "interval": of_median(time.tolist()),
    }


def _ends(sim: Simulator) -> Any:
    """Positions after a second of free motion, from the initial position and others near it."""
    near = np.random.default_rng(0).uniform(-0.5, 0.5, (STARTS, sim.n))
    near[0] = 0.0
    steps = round(DURATION / sim.dt)
    still = np.zeros(sim.n)
    return sim.rollout(sim.state.q + near, 0.0 * near, still, steps, last_only=True)[:, : sim.n]


def _job(sim: Simulator) -> Any:
    """Processor time of a motion of one arm without its recording."""
    still = np.zeros(sim.n)
    start = sim.state.q[None], sim.state.v[None]

    def roll() -> Any:
        return sim.rollout(*start, still, TICKS, last_only=True, lanes=1, threads=1)

    return lambda: cpu(roll)


def _row(item: tuple[str, dict[str, Any]]) -> tuple[str, ...]:
    name, found = item
    errors = [f"{found['errors'][m][k]:.2g}" for k in range(len(STEPS)) for m in METHODS]
    low, high = found["interval"]
    ratios = (f"{found[f'{what} ratio']:.2f}" for what in ("error", "time"))
    return name, *errors, *ratios, f"{low:.2f} – {high:.2f}"


if __name__ == "__main__":
    main()
