# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.derivatives``: derivatives of a tick, next to other simulators."""

import click
import numpy as np

from benchmarks.derivatives.contenders import Arm
from benchmarks.measurement.timing import Cost, Noise, interleaved, steady
from benchmarks.reporting.markdown import table
from benchmarks.robots.models import panda

FOUR = "four computeABADerivatives"
# Upper limits of ratios, and of what.
RATIOS = {
    "A and B of a tick ÷ four computeABADerivatives":
        (0.45, "linearize_many, one state at a time", FOUR),
    "in SIMD lanes ÷ one state at a time":
        (0.25, "linearize_many, in SIMD lanes", "linearize_many, one state at a time"),
    "dry friction ÷ smooth":
        (1.5, "linearize_many, dry friction", "linearize_many, one state at a time"),
    "above a table ÷ smooth":
        (1.5, "linearize_many, above a table", "linearize_many, one state at a time"),
    "gradient of a rollout ÷ rollout": (5.0, "rollout_gradient, a tick", "rollout, a tick"),
    "gradient of a rollout with dry friction ÷ rollout":
        (6.0, "rollout_gradient, a tick, dry friction", "rollout, a tick, dry friction"),
    "gradient of a rollout with reversals ÷ rollout":
        (6.0, "rollout_gradient, a tick, reversing", "rollout, a tick, reversing"),
}  # fmt: skip


@click.command()
@click.option("--repeats", default=60, show_default=True, help="Number of rounds.")
def main(repeats: int) -> None:
    """Time derivatives of an RK4 tick of a Panda, next to Pinocchio and MuJoCo in the same run."""
    arm = Arm(panda())
    parts = arm.ours, arm.rough, arm.eventful, arm.pinocchio, arm.mujoco, arm.gradients
    contenders = {name: contender for part in parts for name, contender in part().items()}
    jobs = {name: steady(lambda: None, call) for name, (call, _) in contenders.items()}
    measured = interleaved(jobs, repeats, Noise(), lambda: None)
    costs = {name: cost.scaled(1 / contenders[name][1]) for name, cost in measured.items()}
    rows = [[name, f"{1e6 * c.median:.2f}", f"{1e6 * c.low:.2f} – {1e6 * c.high:.2f}"]
            for name, c in costs.items()]  # fmt: skip
    results = ratios(costs)
    click.echo(table(("processor time of one core", "median [µs]", "quartiles"), rows) + "\n")
    click.echo(table(("ratio, within each round", "median", "quartiles", "limit"), [
        (name, f"{r.median:.3f}", f"{r.low:.3f} – {r.high:.3f}", f"≤ {RATIOS[name][0]:.3f}")
        for name, r in results.items()
    ]) + "\n")  # fmt: skip
    errors = [(name, f"{error:.1e}") for name, error in arm.errors().items()]
    click.echo(table(("error of A, relative", ""), errors))


def ratios(costs: dict[str, Cost]) -> dict[str, Cost]:
    samples = {name: np.array(cost.samples) for name, cost in costs.items()}
    call = samples["Pinocchio, the same call for one joint"]
    samples[FOUR] = 4.0 * (samples["Pinocchio, computeABADerivatives"] - call)
    return {
        name: Cost.of((samples[ours] / samples[theirs]).tolist())
        for name, (_, ours, theirs) in RATIOS.items() if theirs in samples
    }  # fmt: skip


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.derivatives")
