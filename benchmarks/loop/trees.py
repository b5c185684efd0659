# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.loop.trees``: closed loops of several trees of the sources, side by side.

What a host does to one it does to all, so their ratios say more than runs one after another. Put
an older tree there with ``git worktree add``; if its interfaces are others, build them into its
folder ``install`` with ``colcon build --base-paths src/arm_msgs --merge-install``.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import click
from rclpy.node import Node
from std_srvs.srv import Trigger

from arm_dynamics.ros.common.executor import make_executor
from arm_dynamics.ros.common.transport import as_usual
from arm_sim.cli.interrupts import interruptible
from benchmarks.loop.baseline import PERIOD
from benchmarks.loop.leader import WARM, lead, leader_node
from benchmarks.loop.stages import Baseline
from benchmarks.measurement.watcher import Watcher
from benchmarks.reporting.markdown import table

ROOT = Path(__file__).parents[2]
SUITE = ("-m", "arm_sim.cli")
RECORDED = ":record"  # at the end of a tree's name
PATIENCE = 20.0  # [s] for a process to end
HEARD = 2.0  # [s] between looks at what diagnostics came
HEAD = ("", "sim [% of a core]", "its busiest thread", "controller", "ticks", "missed",
        "p50 late [µs]", "p99 late [µs]", "round trip p50 [ms]")  # fmt: skip
Record = dict[str, Any]
Spent = dict[str, float]  # processor time in [s] by thread


@click.command()
@click.option("--seconds", type=float, default=60.0, show_default=True)
@click.argument("trees", nargs=-1, required=True)
def main(seconds: float, trees: tuple[str, ...]) -> None:
    """Run a sim and a controller of each of TREES for a while; TREE:record records its sim."""
    with tempfile.TemporaryDirectory() as name, interruptible():
        click.echo(shown(measure(seconds, trees, Path(name))))


def measure(
    seconds: float,
    trees: Sequence[str],
    folder: Path,
    *more: str,
    program: Sequence[str] = SUITE,
    period: int = PERIOD,
    beside: Callable[[Node], AbstractContextManager[None]] = lambda leader: nullcontext(),
) -> list[Record]:
    """Run loops of trees at once, and a bare thread beside them.

    Args:
        seconds: How long.
        trees: Folders.
        folder: For logs.
        more: Arguments of the sims.
        program: What runs the sims: arguments of Python.
        period: Time between deadlines in [ns].
        beside: What else goes on in a loop's domain, which is that of a node.

    Returns:
        What was measured of each tree, and of the bare thread.
    """
    with ExitStack() as stack:
        loops, watchers = [], []
        for number, tree in enumerate(trees):
            leader = stack.enter_context(leader_node())
            domain, place = leader.context.get_domain_id(), folder / str(number)
            running = closed_loop(tree, domain, place, *more, program=program)
            loops.append((leader, stack.enter_context(running)))
            watchers.append(stack.enter_context(closing(Watcher(domain))))
            stack.enter_context(beside(leader))
            lead(leader, seconds + 2.0 * WARM)
        time.sleep(WARM)
        bare = stack.enter_context(Baseline("thread", seconds, str(period)))
        for number, (leader, _) in enumerate(loops):
            _reset_counters(leader, folder / str(number) / "sim.log")
        before, began = [used(ids) for _, ids in loops], time.monotonic()
        while (left := began + seconds - time.monotonic()) > 0.0:
            time.sleep(min(HEARD, left))
            for watcher in watchers:
                watcher.listen(0.05)
        passed = time.monotonic() - began
        after = [used(ids) for _, ids in loops]
        rows = [
            {"name": tree} | _shares(*spans, passed) | _told(watcher)
            for tree, watcher, *spans in zip(trees, watchers, before, after, strict=True)
        ]
        return [*rows, {"name": "bare thread"} | bare.result()]


def shown(records: Sequence[Record]) -> str:
    """A table of records."""
    rows = []
    for r in records:
        shares = (f"{100.0 * r[key]:.1f}" if key in r else "—"
                  for key in ("share", "thread", "controller"))  # fmt: skip
        trip = f"{1e3 * r['trip']:.3f}" if "trip" in r else "—"
        rows.append((r["name"], *shares, f"{r['ticks']:,}", f"{r['missed']:,}",
                     f"{1e6 * r['p50']:.0f}", f"{1e6 * r['p99']:.0f}", trip))  # fmt: skip
    return table(HEAD, rows)


def _shares(before: Sequence[Spent], after: Sequence[Spent], passed: float) -> Record:
    """Shares of a core of the sim, of its busiest thread, and of the controller."""
    sim, controller = (
        {thread: used - old.get(thread, 0.0) for thread, used in new.items()}
        for old, new in zip(before, after, strict=True)
    )
    return {
        "share": sum(sim.values()) / passed, "thread": max(sim.values()) / passed,
        "controller": sum(controller.values()) / passed,
    }  # fmt: skip


def _told(watcher: Watcher) -> Record:
    """What the diagnostics of a sim said last."""
    loop = watcher.latest["sim: loop"]
    return {
        "ticks": int(loop["ticks"]), "missed": int(loop["missed"]),
        "warned": "sim: loop" in watcher.warned,
        "p50": float(loop["lateness p50 [s]"]), "p99": float(loop["lateness p99 [s]"]),
        "trip": float(watcher.latest["sim: commands"]["round trip p50 [s]"]),
    }  # fmt: skip


def _reset_counters(leader: Node, log: Path) -> None:
    client, executor = leader.create_client(Trigger, "sim/reset_counters"), make_executor(leader)
    try:
        if not client.wait_for_service(20.0):
            raise click.ClickException(f"a sim does not run: {log.read_text()[-2000:]}")
        done = client.call_async(Trigger.Request())
        while not done.done():
            executor.spin_once(timeout_sec=1.0)
    finally:
        executor.remove_node(leader)
        executor.shutdown()


def surroundings(tree: str, domain: int) -> dict[str, str]:
    """Environment of a tree's processes: its sources, and its interfaces if they were built."""
    path = tree.removesuffix(RECORDED)
    others = [p for p in os.environ.get("PYTHONPATH", "").split(":") if "/src/arm_" not in p]
    first, built = [f"{path}/src/arm_sim", f"{path}/src/arm_dynamics"], Path(path) / "install"
    made = os.environ | as_usual() | {"ROS_DOMAIN_ID": str(domain)}
    if built.is_dir():
        first += map(str, built.glob("lib/python*/site-packages"))
        made["LD_LIBRARY_PATH"] = f"{built}/lib:{made.get('LD_LIBRARY_PATH', '')}"
        made["AMENT_PREFIX_PATH"] = f"{built}:{made.get('AMENT_PREFIX_PATH', '')}"
    return made | {"PYTHONPATH": ":".join([*first, path, *others])}


@contextmanager
def closed_loop(
    tree: str, domain: int, folder: Path, *more: str, program: Sequence[str] = SUITE
) -> Iterator[list[int]]:
    """Sim and controller of a tree in a domain; their process ids."""
    folder.mkdir(parents=True)
    parameters = list(more)
    if tree.endswith(RECORDED):
        parameters += ["-p", f"record:={folder / 'run.mcap'}"]
    wanted = ["--ros-args", *parameters] if parameters else []
    scene = f"{tree.removesuffix(RECORDED)}/src/arm_sim/arm_sim/scenes/panda.yaml"
    started = []
    try:
        for runs, command in (
            (program, ["sim", scene, *wanted]),
            (SUITE, ["controller", scene]),
        ):
            words = [sys.executable, "-P", *runs, *command[:2], "--with-parent"]
            with (folder / f"{command[0]}.log").open("w") as log:
                started.append(
                    subprocess.Popen(
                        [*words, *command[2:]],
                        env=surroundings(tree, domain),
                        stdout=log,
                        stderr=log,
                    )  # fmt: skip
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


def used(ids: Sequence[int]) -> list[Spent]:
    """Processor time of processes in [s], by thread."""
    return [
        {
            task.name: 1e-9 * int((task / "schedstat").read_text().split()[0])
            for task in Path(f"/proc/{pid}/task").iterdir()
        }
        for pid in ids
    ]


if __name__ == "__main__":
    main()
