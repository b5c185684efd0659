# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.identification``."""

import json
import resource
from pathlib import Path

import click
import numpy as np

from benchmarks.identification import known_truth
from benchmarks.reporting.markdown import table


@click.command()
@click.option("--seeds", default=20, show_default=True, help="Number of robots to identify.")
@click.option("--out", default=Path("reports/identification.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(seeds: int, out: Path) -> None:
    """A Panda of known bodies and friction under noise: masses, intervals, time."""
    print("searching an exciting motion", flush=True)
    motion, nominal = known_truth.motion(), known_truth.nominal_scene()
    found = []
    for seed in range(seeds):
        found.append(known_truth.outcome(nominal, motion, seed))
        one = found[-1]
        print(
            f"robot {seed}: masses off by {one.mass_error:.3%}, {one.held.mean():.1%} of "
            f"{one.held.size} intervals hold the truth, {one.seconds:.1f} s", flush=True,
        )  # fmt: skip
    told = {
        "condition of the motion": motion.condition,
        "mean error of masses": float(np.mean([x.mass_error for x in found])),
        "worst mean error of masses of a robot": max(x.mass_error for x in found),
        "intervals that hold the truth": float(np.concatenate([x.held for x in found]).mean()),
        "robots whose links are all possible": sum(x.possible for x in found),
        "robots": seeds,
        "largest torque error of a joint": max(x.worst_joint for x in found),
        "processor time, mean [s]": float(np.mean([x.seconds for x in found])),
        "memory at most [MB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }
    print(table(["", ""], [[name, f"{value:.4g}"] for name, value in told.items()]))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(told, indent=1))


main(prog_name="python -m benchmarks.identification")
