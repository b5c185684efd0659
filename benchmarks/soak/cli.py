# SPDX-License-Identifier: Apache-2.0
"""The command line of the soak."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from shutil import move
from tempfile import TemporaryDirectory

import click

from arm_dynamics import ArmError
from arm_dynamics.ros.common.transport import as_usual, by_udp
from arm_sim.cli.demo.processes import DemoFailed, free_domain
from arm_sim.cli.interrupts import interruptible

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "src/arm_sim/arm_sim/scenes/panda.yaml"
EXAMPLES = """\b
Examples:
  ./arm soak                     an hour
  ./arm soak --minutes 5         every fault about twice
"""


@click.command(epilog=EXAMPLES)
@click.option("--minutes", default=60.0, show_default=True, type=click.FloatRange(3.0),
              help="Duration.")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, file_okay=False),
              default=ROOT / "benchmarks/results", show_default="benchmarks/results",
              help="Folder for soak.md, soak.json, the logs, and the recording of stamps and "
              "commands, if anything is amiss.")  # fmt: skip
@click.option("--shared-memory", is_flag=True,
              help="Let the nodes talk by shared memory too, as Fast DDS does by itself: version "
              "2.14 now and then loses a partner that was stopped for a second.")  # fmt: skip
def main(minutes: float, out: Path, shared_memory: bool) -> None:
    """Run all nodes under load for a long time, put faults in, and tell what came of each.

    Messages that are not finite or of wrong sizes, floods, a second controller, nodes stopped and
    killed, time that jumps, processors taken away. Every fault has to show in the diagnostics, the
    arm must go on where the fault is none of its business, everything has to be well again within
    seconds, no stamp may be out of step by more than 1 % of a tick and no command called stale
    without reason, and no process may grow by more than 5 MB. Ends with an error if anything is
    amiss.
    """
    from benchmarks.soak.page import complaints, page, write
    from benchmarks.soak.result import Result
    from benchmarks.soak.run import judge_recording, soak
    from benchmarks.soak.system import RECORDING, running

    domain = free_domain()
    shared = {**as_usual(), "FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}
    os.environ |= {"ROS_DOMAIN_ID": str(domain), **(shared if shared_memory else by_udp())}
    logs = out / "soak_logs"
    logs.mkdir(parents=True, exist_ok=True)
    result = Result(minutes)

    def progress(share: float, what: str) -> None:
        click.echo(f"{100.0 * share:5.1f} %  {what}", err=True)

    with interruptible():
        try:
            with TemporaryDirectory(prefix="arm_soak_") as recordings:
                try:
                    with running(str(SCENE), domain, logs, Path(recordings)) as system:
                        for result in soak(system, minutes, progress):
                            write(result, out)  # a run that is cut short is not lost
                finally:
                    recording = Path(recordings) / RECORDING
                    judge_recording(result, recording)
                    if complaints(result) and recording.exists():
                        move(recording, logs / RECORDING)
        except (DemoFailed, ArmError, KeyboardInterrupt) as error:
            result.ended = str(error) or type(error).__name__
    path = write(result, out)
    click.echo(page(result))
    click.echo(f"report: {path}")
    sys.exit(bool(complaints(result)))
