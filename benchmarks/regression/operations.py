# SPDX-License-Identifier: Apache-2.0
"""What an evaluation of each scene costs in arithmetic operations: a gate that no host can turn.

Times change with the machine; the number of operations that the generated code carries out does
not. ``operations.yaml`` has it for every bundled scene and for each feature on a Panda. A test
fails where a change makes one larger.
"""

from pathlib import Path
from typing import Any

import click
import yaml

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.scene import ready_scenes
from arm_sim.plant.plant import Plant
from benchmarks.studies import features

FILE = Path(__file__).with_name("operations.yaml")


def scenes() -> dict[str, Any]:
    """Bundled scenes by name, and the Panda with one feature added or taken away."""
    return {name: name for name in ready_scenes()} | {
        f"Panda: {label}": scene for label, scene in features.scenes().items()
    }


def count(scene: Any) -> int:
    """Arithmetic operations of the equation of motion, away from the stops."""
    plant = Plant(ArmModel(load_scene(scene)))
    return operations((plant.free or plant).rhs)


def recorded() -> dict[str, int]:
    return dict(yaml.safe_load(FILE.read_text()))


@click.command()
@click.option("--renew", is_flag=True, help="Write the file, for changes that are worth it.")
def main(renew: bool) -> None:
    """Print the differences from the file, and update it on request."""
    before = recorded() if FILE.exists() else {}
    now = {name: count(scene) for name, scene in scenes().items()}
    for name in sorted(before.keys() | now.keys()):
        if before.get(name) != now.get(name):
            print(f"{name}: {before.get(name)} -> {now.get(name)}")
    if renew:
        head = "# By `python -m benchmarks.regression.operations --renew`.\n"
        FILE.write_text(head + yaml.safe_dump(now, allow_unicode=True, sort_keys=True))


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.regression.operations")
