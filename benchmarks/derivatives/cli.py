# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.derivatives``: derivatives of a tick, next to other simulators."""

import json
from pathlib import Path

import click
import numpy as np

from benchmarks.derivatives.contenders import Arm
from benchmarks.measurement.timing import Cost, Noise, interleaved, steady
from benchmarks.reporting.markdown import table
from benchmarks.robots.models import panda

FOUR = "four computeABADerivatives"
# Upper limits of ratios, and of what.
RATIOS = {
    "A and B of a tick ÷ MuJoCo's forward differences":
        (1 / 12, "linearize_many, one state at a time", "MuJoCo, 3n + 1 RK4 steps"),
    "A and B of a tick ÷ four computeABADerivatives":
        (0.45, "linearize_many, one state at a time", FOUR),
    "in SIMD lanes ÷ one state at a time":
        (0.25, "linearize_many, in SIMD lanes", "linearize_many, one state at a time"),
    "dry friction ÷ smooth":
        (1.5, "linearize_many, dry friction", "linearize_many, one state at a time"),
    "above a table ÷ smooth":
        (1.5, "linearize_many, above a table", "linearize_many, one state at a time"),
    "dry friction ÷ MuJoCo's with friction loss":
        (0.1, "linearize_many, dry friction", "MuJoCo, mjd_transitionFD with friction loss"),
    "a call with dry friction ÷ MuJoCo's with friction loss":
        (0.1, "linearize, dry friction, one call from Python",
         "MuJoCo, mjd_transitionFD with friction loss"),
} | {
    f"gradient of a rollout{what} ÷ rollout":
        (limit, f"rollout_gradient, a tick{kind}", f"rollout, a tick{kind}")
    for what, kind, limit in (
        ("", "", 5.0), (" in SIMD lanes", ", in SIMD lanes", 5.0),
        (" with dry friction", ", dry friction", 6.0), (" with reversals", ", reversing", 6.0),
    )
}  # fmt: skip


@click.command()
@click.option("--repeats", default=60, show_default=True, help="Number of rounds.")
@click.option("--out", default=Path("reports/derivatives.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(repeats: int, out: Path) -> None:
    """Time derivatives of an RK4 tick of a Panda, next to Pinocchio and MuJoCo in the same run."""
    arm, noise = Arm(panda()), Noise()
    parts = arm.ours, arm.rough, arm.eventful, arm.pinocchio, arm.mujoco, arm.gradients
    contenders = {name: contender for part in parts for name, contender in part().items()}
    jobs = {name: steady(lambda: None, call) for name, (call, _) in contenders.items()}
    measured = interleaved(jobs, repeats, noise, lambda: None)
    costs = {name: cost.scaled(1 / contenders[name][1]) for name, cost in measured.items()}
    rows = [[name, f"{1e6 * c.median:.2f}", f"{1e6 * c.low:.2f} – {1e6 * c.high:.2f}"]
            for name, c in costs.items()]  # fmt: skip
    results = ratios(costs)
    errors = arm.errors()
    click.echo(table(("processor time of one core", "median [µs]", "quartiles"), rows) + "\n")
    click.echo(table(("ratio, within each round", "median", "quartiles", "limit"), [
        (name, f"{r.median:.3f}", f"{r.low:.3f} – {r.high:.3f}", f"≤ {RATIOS[name][0]:.3f}")
        for name, r in results.items()
    ]) + "\n")  # fmt: skip
    click.echo(table(("error of A, relative", ""), [[k, f"{e:.1e}"] for k, e in errors.items()]))
    out.parent.mkdir(parents=True, exist_ok=True)
    record = {
        "seconds": {name: [c.low, c.median, c.high] for name, c in costs.items()},
        "ratios": {name: [r.low, r.median, r.high] for name, r in results.items()},
        "errors": errors,
        "machine": noise.summary(),
    }
    out.write_text(json.dumps(record, indent=1))


def ratios(costs: dict[str, Cost]) -> dict[str, Cost]:
    samples = {name: np.array(cost.samples) for name, cost in costs.items()}
    call = samples["Pinocchio, the same call for one joint"]
    samples[FOUR] = 4.0 * (samples["Pinocchio, computeABADerivatives"] - call)
    return {
        name: Cost.of((samples[ours] / samples[theirs]).tolist())
        for name, (_, ours, theirs) in RATIOS.items() if theirs in samples
    }  # fmt: skip
