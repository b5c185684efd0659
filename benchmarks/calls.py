# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.calls``."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import click
import numpy as np
import pinocchio as pin

from arm_dynamics import Dynamics, load_scene
from benchmarks.measurement.intervals import of_median
from benchmarks.measurement.timing import Noise, cpu, interleaved
from benchmarks.reporting.markdown import table

CALLS, FRAME = 2000, "panda_hand"
Answer = Callable[[], Any]
KINDS = "compiled", "plain", "pinocchio"


@click.command()
@click.option("--repeats", default=40, show_default=True, help="Rounds.")
@click.option("--out", default=Path("reports/calls.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(repeats: int, out: Path) -> None:
    """Time calls for one state of a Panda with viscous and dry friction, in turn.

    Pinocchio, which is called directly with arrays of the same process, computes the rigid part.
    """
    noise, results = Noise(), {}
    scene = load_scene("panda").model_dump(exclude_unset=True)
    scene["joints"] = {"*": {"friction": {"coulomb": 1.0, "viscous": 0.5}}}
    plain, built = _timed(lambda: Dynamics(load_scene(scene)))
    compiled, more = _timed(lambda: plain.compiled(FRAME))
    click.echo(f"built in {built:.3f} s, compiled or loaded in {more:.3f} s of processor time")
    quick, slow = _calls(compiled), _calls(plain)
    for name, (ours, theirs) in quick.items():
        answers = dict(zip(KINDS, (ours, slow[name][0], theirs), strict=True))
        calls = {kind: partial(cpu, partial(_often, call)) for kind, call in answers.items()}
        costs = interleaved(calls, repeats, noise, lambda: None)
        results[name] = {kind: 1e6 * cost.median / CALLS for kind, cost in costs.items()}
        ratio = np.divide(costs["compiled"].samples, costs["pinocchio"].samples)
        results[name] |= {"ratio": float(np.median(ratio)), "interval": of_median(ratio.tolist())}
    heads = "call", "compiled [µs]", "plain [µs]", "Pinocchio [µs]", "ratio", "95 % interval"
    click.echo(table(heads, map(_row, results.items())))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps({"calls": results, "machine": noise.summary()}, indent=1))


def _timed(make: Callable[[], Dynamics]) -> tuple[Dynamics, float]:
    begin = process_time()
    return make(), process_time() - begin


def _calls(d: Dynamics) -> dict[str, tuple[Answer, Answer]]:
    """Calls of ``Dynamics``, each beside Pinocchio's, which has no friction."""
    q, v, x = map(np.array, np.random.default_rng(0).normal(size=(3, 7)))
    m, data, frame = d.model.pin, d.model.pin.createData(), d.model.frame_index(FRAME)
    axes, world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, pin.Convention.WORLD

    def energy() -> tuple[float, float]:
        kinetic = pin.computeKineticEnergy(m, data, q, v)
        return kinetic, pin.computePotentialEnergy(m, data, q)

    def pose() -> Any:
        pin.forwardKinematics(m, data, q)
        return pin.updateFramePlacement(m, data, frame).homogeneous

    return {
        "inverse": (lambda: d.inverse(q, v, x), lambda: pin.rnea(m, data, q, v, x)),
        "forward": (lambda: d.forward(q, v, x), lambda: pin.aba(m, data, q, v, x, world)),
        "mass_matrix": (lambda: d.mass_matrix(q), lambda: pin.crba(m, data, q)),
        "coriolis_matrix": (
            lambda: d.coriolis_matrix(q, v), lambda: pin.computeCoriolisMatrix(m, data, q, v)
        ),
        "gravity": (
            lambda: d.gravity(q), lambda: pin.computeGeneralizedGravity(m, data, q)
        ),
        "friction": (lambda: d.friction(v), lambda: None),
        "energy": (lambda: d.energy(q, v), energy),
        "pose": (lambda: d.pose(q, FRAME), pose),
        "jacobian": (
            lambda: d.jacobian(q, FRAME),
            lambda: pin.computeFrameJacobian(m, data, q, frame, axes),
        ),
    }  # fmt: skip


def _often(call: Answer) -> None:
    for _ in range(CALLS):
        call()


def _row(item: tuple[str, dict[str, Any]]) -> tuple[str, ...]:
    name, result = item
    row = name, f"{result['compiled']:.2f}", f"{result['plain']:.1f}"
    if name == "friction":
        return *row, "", "", ""
    low, high = result["interval"]
    ratio = f"{result['ratio']:.2f}"
    return *row, f"{result['pinocchio']:.2f}", ratio, f"{low:.2f} – {high:.2f}"


if __name__ == "__main__":
    main()
