# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.derivatives``: derivatives of a tick, next to other simulators."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np

from benchmarks.derivatives.contenders import Arm
from benchmarks.measurement.timing import Cost, Noise, interleaved, steady
from benchmarks.reporting.markdown import table
from benchmarks.robots.models import panda

LIMITS = {
    "A and B of a tick ÷ MuJoCo's forward differences": 1 / 12,
    "A and B of a tick ÷ four computeABADerivatives": 0.45,
    "in SIMD lanes ÷ one state at a time": 0.25,
    "gradient of a rollout ÷ rollout": 5.0,
    "gradient of a rollout ÷ rollout, in SIMD lanes": 5.0,
    "dry friction ÷ smooth": 1.5,
    "above a table ÷ smooth": 1.5,
    "dry friction ÷ MuJoCo's with friction loss": 0.1,
    "a call with dry friction ÷ MuJoCo's with friction loss": 0.1,
    "gradient of a rollout with dry friction ÷ rollout": 6.0,
    "gradient of a rollout with reversals ÷ rollout": 6.0,
}
"""Upper limits of the ratios."""


@click.command()
@click.option("--repeats", default=60, show_default=True, help="Number of rounds.")
@click.option("--out", default=Path("reports/derivatives.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(repeats: int, out: Path) -> None:
    """Time derivatives of an RK4 tick of a Panda, next to Pinocchio and MuJoCo in the same run."""
    arm, noise = Arm(panda()), Noise()
    contenders = (
        arm.ours()
        | arm.rough()
        | arm.eventful()
        | arm.pinocchio()
        | arm.mujoco()
        | arm.gradients()
    )
    jobs = {name: steady(lambda: None, call) for name, (call, _) in contenders.items()}
    measured = interleaved(jobs, repeats, noise, lambda: None)
    costs = {name: cost.scaled(1 / contenders[name][1]) for name, cost in measured.items()}
    rows = [[name, f"{1e6 * c.median:.2f}", f"{1e6 * c.low:.2f} – {1e6 * c.high:.2f}"]
            for name, c in costs.items()]  # fmt: skip
    results = ratios(costs)
    errors = arm.errors()
    click.echo(table(("processor time of one core", "median [µs]", "quartiles"), rows) + "\n")
    click.echo(table(("ratio, within each round", "median", "quartiles", "limit"), [
        (name, f"{r.median:.3f}", f"{r.low:.3f} – {r.high:.3f}", f"≤ {LIMITS[name]:.3f}")
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
    """Ratios of samples of the same round."""
    samples = {name: np.array(cost.samples) for name, cost in costs.items()}
    ours = samples["linearize_many, one state at a time"]
    call = samples["Pinocchio, the same call for one joint"]
    theirs = 4.0 * (samples["Pinocchio, computeABADerivatives"] - call)
    results = {
        "A and B of a tick ÷ four computeABADerivatives": ours / theirs,
        "in SIMD lanes ÷ one state at a time": samples["linearize_many, in SIMD lanes"] / ours,
    }
    if "MuJoCo, 3n + 1 RK4 steps" in samples:
        results["A and B of a tick ÷ MuJoCo's forward differences"] = (
            ours / samples["MuJoCo, 3n + 1 RK4 steps"]
        )
    for name in ("dry friction", "above a table"):
        results[f"{name} ÷ smooth"] = samples[f"linearize_many, {name}"] / ours
    if (peer := "MuJoCo, mjd_transitionFD with friction loss") in samples:
        results["dry friction ÷ MuJoCo's with friction loss"] = (
            samples["linearize_many, dry friction"] / samples[peer]
        )
        results["a call with dry friction ÷ MuJoCo's with friction loss"] = (
            samples["linearize, dry friction, one call from Python"] / samples[peer]
        )
    for name, what in (("dry friction", "dry friction"), ("reversals", "reversing")):
        results[f"gradient of a rollout with {name} ÷ rollout"] = (
            samples[f"rollout_gradient, a tick, {what}"] / samples[f"rollout, a tick, {what}"]
        )
    for way in ("", ", in SIMD lanes"):
        name = f"gradient of a rollout ÷ rollout{way}"
        results[name] = (
            samples[f"rollout_gradient, a tick{way}"] / samples[f"rollout, a tick{way}"]
        )
    return {name: Cost.of(values.tolist()) for name, values in results.items()}
