# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.calls``."""

from collections.abc import Callable
from functools import partial
from typing import Any

import click
import numpy as np
import pinocchio as pin

from arm_dynamics import Dynamics, load_scene
from benchmarks.measurement.intervals import of_median
from benchmarks.measurement.timing import Noise, interleaved
from benchmarks.reporting.markdown import table
from benchmarks.studies.cost import repeated

CALLS = 2000
HEADS = "call", "compiled [µs]", "plain [µs]", "Pinocchio [µs]", "ratio", "95 % interval"


@click.command()
@click.option("--repeats", default=40, show_default=True, help="Rounds.")
def main(repeats: int) -> None:
    """Time calls for one state of a Panda with viscous and dry friction, in turn.

    Pinocchio, which is called directly with arrays of the same process, computes the rigid part.
    """
    scene = load_scene("panda").model_dump(exclude_unset=True)
    scene["joints"] = {"*": {"friction": {"coulomb": 1.0, "viscous": 0.5}}}
    plain = Dynamics(load_scene(scene))
    compiled, model, data = plain.compiled(), plain.model.pin, plain.model.pin.createData()
    q, v, x = map(np.array, np.random.default_rng(0).normal(size=(3, 7)))
    theirs: dict[str, Callable[[], Any]] = {
        "inverse": lambda: pin.rnea(model, data, q, v, x),
        "forward": lambda: pin.aba(model, data, q, v, x, pin.Convention.WORLD),
    }
    rows = []
    for name, call in theirs.items():
        ours = (partial(getattr(each, name), q, v, x) for each in (compiled, plain))
        jobs = {k: repeated(each, CALLS) for k, each in enumerate((*ours, call))}
        costs = interleaved(jobs, repeats, Noise(), lambda: None)
        ratio = np.divide(costs[0].samples, costs[2].samples)
        low, high = of_median(ratio.tolist())
        micro = [f"{1e6 * cost.median:.2f}" for cost in costs.values()]
        rows.append((name, *micro, f"{np.median(ratio):.2f}", f"{low:.2f} – {high:.2f}"))
    click.echo(table(HEADS, rows))


if __name__ == "__main__":
    main()
