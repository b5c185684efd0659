# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.loop.hold OLDER``: the loop of this tree beside that of an older one.

Both run at once, with a bare thread in C that sleeps to the same deadlines: what a host does to
one it does to all, so that their ratios say more than runs one after another. Put the older tree
there with ``git worktree add``; if its interfaces are others, build them into its folder
``install`` with ``colcon build --base-paths src/arm_msgs --merge-install``.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics import Dynamics
from arm_dynamics.client import ArmClient
from arm_dynamics.ros.common.transport import as_usual
from arm_sim.cli.demo.processes import free_domain
from arm_sim.cli.interrupts import interruptible
from benchmarks.loop.baseline import PERIOD
from benchmarks.loop.stages import Baseline
from benchmarks.measurement.watcher import Watcher, processor_time
from benchmarks.reporting.markdown import table

ROOT = Path(__file__).parents[2]
SCENE = "src/arm_sim/arm_sim/scenes/panda.yaml"
ALLOWED = 1.05  # ratio of this tree's figures to the older one's
FAST = 250_000  # [ns], the period at 4 kHz
WARM, SEEN = 8.0, 3.0  # [s], and until the controller has seen the arm
STEP, REACH = 2.0, 0.25  # [s] from waypoint to waypoint, and how far they are apart in [rad]
PATIENCE = 20.0  # [s] for a process to end
HEARD = 2.0  # [s] between looks at what diagnostics came
HEAD = ("", "sim [% of a core]", "its busiest thread", "controller", "ticks", "missed",
        "p50 late [µs]", "p99 late [µs]", "round trip p50 [ms]")  # fmt: skip
Record = dict[str, Any]
Line = tuple[str, float, float]  # text, limit, measured
Spent = dict[str, float]  # processor time in [s] by thread
ACROSS = """
import json, sys
from pathlib import Path
from benchmarks.loop import lockstep
scene, ticks, logs, domain = sys.argv[1:]
found = lockstep.across(scene, int(ticks), Path(logs), int(domain), False)
print("found", json.dumps(found))
"""


@click.command()
@click.option("--seconds", type=float, default=600.0, show_default=True, help="Of each loop.")
@click.option("--ticks", default=20_000, show_default=True, help="Of each run in lockstep.")
@click.option("--stage", "chosen", type=click.Choice(["ordinary", "fast", "lockstep"]),
              multiple=True, help="Only these; may be repeated.")  # fmt: skip
@click.argument("older", type=click.Path(exists=True, file_okay=False))
def main(seconds: float, ticks: int, chosen: tuple[str, ...], older: str) -> None:
    """Measure the loop beside that of the tree OLDER; print tables and what must hold."""
    lines = list[Line]()
    with tempfile.TemporaryDirectory() as name, interruptible():
        folder = Path(name)
        stages: dict[str, Callable[[], list[Line]]] = {
            "ordinary": lambda: ordinary(seconds, older, folder / "ordinary"),
            "fast": lambda: fast(seconds, folder / "fast"),
            "lockstep": lambda: lockstep(ticks, older, folder),
        }
        for each in chosen or stages:
            click.echo(f"\n{each}, load {os.getloadavg()[0]:.1f}\n", err=True)
            lines += stages[each]()
    rows = [
        (text, f"≤ {limit:.3g}", f"{got:.3g}", "yes" if got <= limit else "**no**")
        for text, limit, got in lines
    ]
    click.echo(table(("line", "limit", "measured", "met"), rows))


def ordinary(seconds: float, older: str, folder: Path) -> list[Line]:
    new, old, bare = measure(seconds, [str(ROOT), older], folder)
    texts = {"share": "share of the sim", "controller": "share of the controller",
             "trip": "round trip p50"}  # fmt: skip
    return [
        *((f"1 kHz: {text}, of the older one's", ALLOWED, new[key] / old[key])
          for key, text in texts.items()),
        _misses("1 kHz", new, bare, 1.3),
        ("1 kHz: lateness p99, of the bare thread's", 1.5, new["p99"] / bare["p99"]),
    ]  # fmt: skip


def fast(seconds: float, folder: Path) -> list[Line]:
    new, bare = measure(seconds, [str(ROOT)], folder, "-p", f"dt:={1e-9 * FAST}", period=FAST)
    silent = float(new["missed"] > 0 and not new["warned"])
    return [
        _misses("4 kHz", new, bare, 2.0), ("4 kHz: whether misses were silent", 0.0, silent)
    ]  # fmt: skip


def _misses(name: str, new: Record, bare: Record, limit: float) -> Line:
    """Misses by ticks, of those of the bare thread."""
    rates = [r["missed"] / r["ticks"] for r in (new, bare)]
    ratio = rates[0] / max(rates[1], 1.0 / bare["ticks"])
    return f"{name}: misses, of the bare thread's", limit, ratio


def lockstep(ticks: int, older: str, folder: Path) -> list[Line]:
    """Both trees in lockstep across two processes, in turn."""
    rates = list[float](), list[float]()
    for tree, own in [*zip((str(ROOT), older), rates, strict=True)] * 3:
        domain, logs = free_domain(), folder / f"lockstep-{time.time_ns()}"
        logs.mkdir()
        words = [f"{tree}/{SCENE}", str(ticks), str(logs), str(domain)]
        done = subprocess.run(
            [sys.executable, "-P", "-c", ACROSS, *words],
            env=surroundings(tree, domain), capture_output=True, text=True, check=False,
        )  # fmt: skip
        _, there, result = done.stdout.partition("found ")
        if not there:
            raise click.ClickException(f"lockstep of {tree}: {done.stderr[-2000:]}")
        own.append(json.loads(result)["rate"])
    new, old = map(float, np.median(rates, axis=1))
    click.echo(f"lockstep, median of 3: {new:,.0f} ticks/s, of the older tree {old:,.0f}\n")
    return [("lockstep: ticks per second of the older tree, of this one's", ALLOWED, old / new)]


def measure(
    seconds: float, trees: Sequence[str], folder: Path, *more: str, period: int = PERIOD
) -> list[Record]:
    """Run loops of trees at once, and a bare thread beside them; print and return the results.

    ``more`` are arguments of the sims, ``period`` is the time between deadlines in [ns].
    """
    with ExitStack() as stack:
        loops, watchers = [], []
        for number, tree in enumerate(trees):
            leader = stack.enter_context(leader_node())
            domain, place = leader.context.get_domain_id(), folder / str(number)
            ids = stack.enter_context(closed_loop(tree, domain, place, *more))
            loops.append((stack.enter_context(ArmClient(timeout=30.0, domain=domain)), ids))
            watchers.append(stack.enter_context(closing(Watcher(domain))))
            lead(leader, seconds + 2.0 * WARM)
        time.sleep(WARM)
        bare = stack.enter_context(Baseline("thread", seconds, str(period)))
        for client, _ in loops:
            client.reset_counters()
        before, began = [[*map(processor_time, ids)] for _, ids in loops], time.monotonic()
        while (left := began + seconds - time.monotonic()) > 0.0:
            time.sleep(min(HEARD, left))
            for watcher in watchers:
                watcher.listen(0.05)
        passed = time.monotonic() - began
        after = [[*map(processor_time, ids)] for _, ids in loops]
        records = [
            {"name": tree} | _shares(*spans, passed) | _diagnosed(watcher)
            for tree, watcher, *spans in zip(trees, watchers, before, after, strict=True)
        ]
        records.append({"name": "bare thread"} | bare.result())
    rows = []
    for r in records:
        shares = (f"{100.0 * r[key]:.1f}" if key in r else "—"
                  for key in ("share", "thread", "controller"))  # fmt: skip
        trip = f"{1e3 * r['trip']:.3f}" if "trip" in r else "—"
        rows.append((r["name"], *shares, f"{r['ticks']:,}", f"{r['missed']:,}",
                     f"{1e6 * r['p50']:.0f}", f"{1e6 * r['p99']:.0f}", trip))  # fmt: skip
    click.echo(table(HEAD, rows) + "\n")
    return records


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


def _diagnosed(watcher: Watcher) -> Record:
    """What the diagnostics of a sim said last."""
    loop = watcher.latest["sim: loop"]
    return {
        "ticks": int(loop["ticks"]), "missed": int(loop["missed"]),
        "warned": "sim: loop" in watcher.warned,
        "p50": float(loop["lateness p50 [s]"]), "p99": float(loop["lateness p99 [s]"]),
        "trip": float(watcher.latest["sim: commands"]["round trip p50 [s]"]),
    }  # fmt: skip


@contextmanager
def leader_node() -> Iterator[Node]:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=free_domain())
    node = Node("leader", context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        context.try_shutdown()


def lead(node: Node, seconds: float) -> None:
    dynamics, rng = Dynamics(str(ROOT / SCENE)), np.random.default_rng(1)
    points = []
    for k in range(round(seconds / STEP)):
        place = dynamics.model.q0 + REACH * rng.uniform(-1.0, 1.0, dynamics.n)
        point = JointTrajectoryPoint(positions=place.tolist())
        point.time_from_start.sec = round(STEP * (k + 1))
        points.append(point)
    publisher = node.create_publisher(JointTrajectory, "controller/joint_trajectory", 10)
    end = time.monotonic() + 60.0
    while time.monotonic() < end and not (
        publisher.get_subscription_count() and node.count_publishers("joint_states")
    ):
        time.sleep(0.1)
    time.sleep(SEEN)
    publisher.publish(JointTrajectory(joint_names=list(dynamics.joint_names), points=points))


def surroundings(tree: str, domain: int) -> dict[str, str]:
    """Environment of a tree's processes: its sources, and its interfaces if they were built."""
    others = [p for p in os.environ.get("PYTHONPATH", "").split(":") if "/src/arm_" not in p]
    first, built = [f"{tree}/src/arm_sim", f"{tree}/src/arm_dynamics"], Path(tree) / "install"
    environment = os.environ | as_usual() | {"ROS_DOMAIN_ID": str(domain)}
    if built.is_dir():
        first += map(str, built.glob("lib/python*/site-packages"))
        libraries = os.environ.get("LD_LIBRARY_PATH", "")
        prefixes = os.environ.get("AMENT_PREFIX_PATH", "")
        environment["LD_LIBRARY_PATH"] = f"{built}/lib:{libraries}"
        environment["AMENT_PREFIX_PATH"] = f"{built}:{prefixes}"
    return environment | {"PYTHONPATH": ":".join([*first, tree, *others])}


@contextmanager
def closed_loop(tree: str, domain: int, folder: Path, *more: str) -> Iterator[list[int]]:
    """Sim and controller of a tree in a domain; their process ids."""
    folder.mkdir(parents=True)
    started = []
    try:
        for name, words in (("sim", ["--ros-args", *more] if more else []), ("controller", [])):
            command = [sys.executable, "-P", "-m", "arm_sim.cli", name, f"{tree}/{SCENE}"]
            with (folder / f"{name}.log").open("w") as log:
                started.append(subprocess.Popen(
                    [*command, "--with-parent", *words],
                    env=surroundings(tree, domain), stdout=log, stderr=log,
                ))  # fmt: skip
        yield [process.pid for process in started]
    finally:
        for process in started:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


if __name__ == "__main__":
    main()
