# SPDX-License-Identifier: Apache-2.0
"""How often a scene is refused as worse: ``python -m benchmarks.identification.held_out``.

Arms and recordings are those of ``coverage``, but the nominal scene is the arm itself, so that
whatever is identified can only be worse. In what is not held out, the first joint has a fraction
more of dry friction: none, by which noise alone makes a difference, or so much that the scene
predicts the rest worse.
"""

from __future__ import annotations

import click
import numpy as np

from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord, identify
from arm_studies.identification.regression.rows import HELD_OUT
from benchmarks.identification.coverage import (
    ARMS,
    DURATION,
    NOISE,
    RESOLUTION,
    recorded,
    true_arm,
)
from benchmarks.identification.lagrange import LagrangeArm
from benchmarks.reporting.markdown import table

MORE = (0.0, 0.1, 0.2, 0.5, 1.0)


def disturbed(arm: LagrangeArm, seed: int, more: float) -> JointRecord:
    """A recording with a fraction more of friction in the first joint, except where held out."""
    t, q, tau = recorded(arm, DURATION)
    noise = np.random.default_rng(seed).standard_normal(tau.shape)
    effort = tau + NOISE * np.sqrt((tau**2).mean(axis=0)) * noise
    way = np.sign(np.gradient(q[:, 0], t)) * (t < (1.0 - HELD_OUT) * DURATION)
    effort[:, 0] += more * arm.coulomb[0] * way
    return JointRecord.of(arm.names, t, RESOLUTION * np.round(q / RESOLUTION), effort)


@click.command()
@click.option("--seeds", default=20, show_default=True, help="Recordings of each arm.")
def main(seeds: int) -> None:
    """How often an identified scene is refused that predicts worse than an exact one."""
    rows = []
    for name, links in ARMS.items():
        arm = true_arm(links)
        for more in MORE:
            refused, ratios = 0, []
            for seed in range(seeds):
                record = disturbed(arm, seed, more)
                found = identify(arm.scene, record, accept_worse=True)
                ratios.append(found.error[0] / found.error[1])
                try:
                    identify(arm.scene, record)
                except InvalidInput:
                    refused += 1
            worse = f"{min(ratios):.2f} to {max(ratios):.2f}"
            rows.append([name, f"{more:.0%}", worse, f"{refused} of {seeds}"])
            print(rows[-1], flush=True)
    print(table(("arm", "more friction", "error over that of the exact scene", "refused"), rows))


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.identification.held_out")
