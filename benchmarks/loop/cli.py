# SPDX-License-Identifier: Apache-2.0
"""The command line of the loop's benchmark."""

import os
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from arm_dynamics.ros.common.transport import as_usual
from arm_sim.cli.demo.processes import DemoFailed, free_domain
from arm_sim.cli.interrupts import interruptible

ROOT = Path(__file__).parents[2]
SCENE = str(ROOT / "src/arm_sim/arm_sim/scenes/panda.yaml")
EXAMPLES = """\b
Examples:
  ./arm bench loop                     about five minutes
  ./arm bench loop --quick             under a minute
  ./arm bench loop --seconds 600       ten minutes of closed loop
  ./arm bench loop --priority 50       sim and controller with real-time priority, where allowed
"""


@click.command(epilog=EXAMPLES)
@click.option(
    "--seconds",
    type=click.FloatRange(5.0),
    help="Duration of the closed loop. [default: 60, quick 10]",
)
@click.option("--priority", default=0, show_default=True, type=click.IntRange(0, 99),
              help="Real-time priority of the closed loop; 0: none.")  # fmt: skip
@click.option("--quick", is_flag=True, help="Shorter runs.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False),
              default=ROOT / "benchmarks/results", show_default="benchmarks/results",
              help="Folder for loop.md, loop.json and figures/loop.png.")  # fmt: skip
def main(seconds: float | None, priority: int, quick: bool, out: Path) -> None:
    """Measure the loop over ROS on a Panda, next to bare rclpy and a bare thread in the same run.

    Rate, missed ticks, lateness, round trip, latency of the service, points per second of batches,
    processor shares, and lockstep. The exit status does not depend on the figures: they are of
    this machine and its load.
    """
    from arm_dynamics.client import ArmClient
    from benchmarks.loop.page import promises, write

    domain = free_domain()
    os.environ |= {"ROS_DOMAIN_ID": str(domain), **as_usual()}
    console = Console(stderr=True)
    # A participant all the time, so that nobody else takes the domain between two stages.
    with interruptible(), ArmClient(domain=domain):
        try:
            seconds = seconds or (10.0 if quick else 60.0)
            record = _measured(seconds, priority, quick, out, domain, console)
        except KeyboardInterrupt:
            raise click.ClickException("interrupted; all processes have been ended") from None
        except DemoFailed as error:
            raise click.ClickException(error.message) from None
    path = write(record, out)
    shown = Table("requirement", "limit", "measured", "met")
    for text, bound, got, holds in promises(record):
        shown.add_row(text, bound, got, "yes" if holds else "[red]no[/red]")
    Console().print(shown)
    click.echo(f"report: {path}")


def _measured(
    seconds: float, priority: int, quick: bool, out: Path, domain: int, console: Console
) -> dict[str, Any]:
    from benchmarks.loop import stages
    from benchmarks.loop.baseline import spread
    from benchmarks.loop.lockstep import lockstep

    logs = out / "loop_logs"
    logs.mkdir(parents=True, exist_ok=True)
    say = console.print
    load, bare_seconds = os.getloadavg()[0], 3.0 if quick else 10.0
    say("ping-pong of rclpy, before the loop and after it: a shared machine changes its speed")
    trips = stages.ping_pong(bare_seconds)
    record: dict[str, Any] = {
        "loop": stages.closed_loop(SCENE, domain, seconds, logs, say, priority)
    }
    trips += stages.ping_pong(bare_seconds)
    record["ping"] = {"count": len(trips), **spread(np.array(trips))}
    say("timer of rclpy")
    with stages.Baseline("timer", bare_seconds) as bare:
        record["timer"] = bare.result()
    say("services and batches")
    record["services"] = stages.services(SCENE, domain, 300 if quick else 2000, logs)
    record["core"] = stages.core(SCENE)
    say("lockstep")
    record["lockstep"] = lockstep(SCENE, 3_000 if quick else 100_000, 100_000, logs, domain)
    record["load"] = [load, os.getloadavg()[0]]
    return record
