# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.loop.trees``: closed loops of several trees of the sources, side by side.

What a host does to one it does to all, so their ratios say more than runs one after another. Put
an older tree there with ``git worktree add``.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import click

from arm_dynamics.ros.common.transport import as_usual
from arm_sim.cli.demo.processes import interruptible
from benchmarks.measurement.watcher import processor_time
from benchmarks.record.overhead import SCENE, WARM, lead, leader_node
from benchmarks.reporting.markdown import table

RECORDED = ":record"  # at the end of a tree's name
PATIENCE = 20.0  # [s] for a process to end
HEAD = ("tree", "sim [% of a core]", "controller", "ticks", "missed", "p50, p99 late [µs]",
        "round trip p50 [ms]")  # fmt: skip


@click.command()
@click.option("--seconds", type=float, default=60.0, show_default=True)
@click.argument("trees", nargs=-1, required=True)
def main(seconds: float, trees: tuple[str, ...]) -> None:
    """Run a sim and a controller of each of TREES for a while; TREE:record records its sim."""
    with tempfile.TemporaryDirectory() as name, interruptible():
        click.echo(table(HEAD, measure(seconds, trees, Path(name))))


def measure(seconds: float, trees: Sequence[str], folder: Path) -> list[tuple[str, ...]]:
    """A row for each tree."""
    with ExitStack() as stack:
        loops = []
        for number, tree in enumerate(trees):
            leader = stack.enter_context(leader_node())
            domain, place = leader.context.get_domain_id(), folder / str(number)
            loops.append(stack.enter_context(closed_loop(tree, domain, place)))
            lead(leader, seconds + 2.0 * WARM)
        time.sleep(WARM)
        before = [used(loop) for loop in loops]
        began = time.monotonic()
        time.sleep(seconds)
        passed = time.monotonic() - began
        after = [used(loop) for loop in loops]
    rows = []
    for number, (tree, old, new) in enumerate(zip(trees, before, after, strict=True)):
        report = json.loads((folder / str(number) / "report.json").read_text())
        loop, late = report["loop"], report["loop"]["lateness"]
        shares = (f"{100.0 * (b - a) / passed:.1f}" for a, b in zip(old, new, strict=True))
        rows.append(
            (
                tree, *shares, str(loop["ticks"]), str(loop["missed"]),
                f"{1e6 * late['p50']:.0f}, {1e6 * late['p99']:.0f}",
                f"{1e3 * report['round_trip']['p50']:.3f}",
            )
        )  # fmt: skip
    return rows


@contextmanager
def closed_loop(tree: str, domain: int, folder: Path) -> Iterator[list[int]]:
    """Sim and controller of a tree in a domain; their process ids."""
    folder.mkdir()
    path = tree.removesuffix(RECORDED)
    others = [p for p in os.environ.get("PYTHONPATH", "").split(":") if "/src/arm_" not in p]
    paths = ":".join([f"{path}/src/arm_sim", f"{path}/src/arm_dynamics", *others])
    surroundings = os.environ | as_usual() | {"ROS_DOMAIN_ID": str(domain), "PYTHONPATH": paths}
    wanted = ["--report", str(folder / "report.json")]
    if tree.endswith(RECORDED):
        wanted += ["--ros-args", "-p", f"record:={folder / 'run.mcap'}"]
    started = []
    try:
        for command in (["sim", *wanted], ["controller"]):
            words = [sys.executable, "-P", "-m", "arm_sim.cli", command[0], SCENE, "--with-parent"]
            with (folder / f"{command[0]}.log").open("w") as log:
                started.append(
                    subprocess.Popen(
                        [*words, *command[1:]], env=surroundings, stdout=log, stderr=log
                    )
                )
        yield [process.pid for process in started]
    finally:
        for process in started:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def used(ids: Sequence[int]) -> list[float]:
    """Processor time of processes in [s]."""
    return [processor_time(pid) for pid in ids]


if __name__ == "__main__":
    main()
