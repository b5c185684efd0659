# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.loop.hold OLDER``: what the loop must keep to, beside an older tree.

Every line is measured in one run, against a bare thread in C that sleeps to the same deadlines, or
against the older tree at the same time; see ``trees`` for how to make one.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any

import click
import numpy as np
import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context

from arm_dynamics import Dynamics
from arm_dynamics.client import ArmClient
from arm_dynamics.ros.common.executor import make_executor
from arm_dynamics.ros.common.transport import as_usual
from arm_sim.cli.demo.processes import Processes, free_domain
from arm_sim.cli.interrupts import interruptible
from benchmarks.loop import stages
from benchmarks.loop.leader import SCENE
from benchmarks.loop.trees import RECORDED, ROOT, measure, shown, surroundings
from benchmarks.reporting.markdown import table

BUSY = str(Path(__file__).with_name("busy.py"))
FAST = 250_000  # [ns], the period at 4 kHz
CALLS = 200.0  # a second
WORSE = 1.1  # times what holds without work beside it
STAGES = ("ordinary", "busy", "fast", "services", "lockstep")
Line = tuple[str, float, float]  # text, limit, measured
ACROSS = """
import json, sys
from pathlib import Path
from benchmarks.loop import lockstep
scene, ticks, logs, domain, recorded = sys.argv[1:]
given = scene, int(ticks), Path(logs), int(domain)
found = lockstep.across(*given, recorded == "recorded")
print("found", json.dumps(found))
"""


@click.command()
@click.option("--seconds", type=float, default=600.0, show_default=True, help="Of each loop.")
@click.option("--ticks", default=20_000, show_default=True, help="Of each run in lockstep.")
@click.option("--stage", "chosen", type=click.Choice(STAGES), multiple=True,
              help="Only these; may be repeated.")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="File for numbers.")
@click.argument("older", type=click.Path(exists=True, file_okay=False))
def main(
    seconds: float, ticks: int, chosen: tuple[str, ...], out: Path | None, older: str
) -> None:
    """Measure what the loop must keep to, beside the tree OLDER; print tables and lines."""
    lines, records = list[Line](), dict[str, Any]()
    with tempfile.TemporaryDirectory() as name, interruptible():
        folder = Path(name)
        stage = {
            "ordinary": lambda: ordinary(seconds, older, folder, records),
            "busy": lambda: busy(seconds, older, folder, records),
            "fast": lambda: fast(seconds, folder, records),
            "services": lambda: services(folder, records),
            "lockstep": lambda: lockstep(ticks, older, folder, records),
        }
        for each in chosen or STAGES:
            click.echo(f"\n{each}, load {os.getloadavg()[0]:.1f}\n", err=True)
            lines += stage[each]()
    rows = [
        (text, f"≤ {limit:.3g}", f"{got:.3g}", "yes" if got <= limit else "**no**")
        for text, limit, got in lines
    ]
    click.echo(table(("line", "limit", "measured", "met"), rows))
    if out is not None:
        out.write_text(json.dumps({"lines": lines, "records": records}, indent=1) + "\n")


def ordinary(seconds: float, older: str, folder: Path, records: dict[str, Any]) -> list[Line]:
    """Loops of both trees at 1 kHz."""
    new, old, bare = records["ordinary"] = measure(
        seconds, [str(ROOT), older], folder / "ordinary"
    )
    click.echo(shown([new, old, bare]) + "\n")
    return [*shares("1 kHz", new, old, 1.0), *kept("1 kHz", new, bare, 1.3, 1.5)]


def busy(seconds: float, older: str, folder: Path, records: dict[str, Any]) -> list[Line]:
    """Loops whose sims answer calls, build kernels, record, and are watched, one after another.

    Two of them at once would keep both processors busy. The older tree does not record.
    """
    records["busy"] = measured = []
    for place, tree in (("busy", f"{ROOT}{RECORDED}"), ("busy-older", older)):
        answered: list[float] = []
        measured += measure(
            seconds, [tree], folder / place, program=(BUSY,),
            beside=lambda leader, to=answered: _bothered(leader.context.get_domain_id(), to),
        )  # fmt: skip
        click.echo(f"{tree}: {len(answered) / (answered[-1] - answered[0]):.0f} calls a second")
    click.echo("\n" + shown(measured) + "\n")
    new, bare, old, _ = measured
    lines = shares("1 kHz, busy", new, old, WORSE)
    lines += kept("1 kHz, busy", new, bare, 1.3 * WORSE, 1.5 * WORSE)
    if "ordinary" in records:
        calm = records["ordinary"][0]
        for key, text in (("thread", "the sim's loop thread"), ("controller", "the controller"),
                          ("trip", "the round trip p50")):  # fmt: skip
            lines.append((f"1 kHz, busy: {text}, of that at ease", WORSE, new[key] / calm[key]))
    return lines


@contextmanager
def _bothered(domain: int, answered: list[float]) -> Iterator[None]:
    """Call a service of a sim, and watch it; when answers came is noted."""
    words = [sys.executable, "-P", "-m", "arm_sim.cli", "view", SCENE, "--live", "--port", "0"]
    view = subprocess.Popen(words, env=surroundings(str(ROOT), domain),
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    ended = Event()
    caller = Thread(target=_call, args=(domain, answered, ended))
    caller.start()
    try:
        yield
    finally:
        ended.set()
        caller.join()
        view.terminate()
        view.wait()


def _call(domain: int, answered: list[float], ended: Event) -> None:
    """Ask for a parameter at a steady rate, one call after the other."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = rclpy.create_node("caller", context=context)
    client, executor = node.create_client(GetParameters, "sim/get_parameters"), make_executor(node)
    client.wait_for_service(30.0)
    request, due = GetParameters.Request(names=["dt"]), time.monotonic()
    while not ended.wait(max(0.0, due - time.monotonic())):
        due += 1.0 / CALLS
        future = client.call_async(request)
        while not future.done() and not ended.is_set():
            executor.spin_once(timeout_sec=0.1)
        answered.append(time.monotonic())
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def fast(seconds: float, folder: Path, records: dict[str, Any]) -> list[Line]:
    """A loop at 4 kHz."""
    new, bare = records["fast"] = measure(
        seconds, [str(ROOT)], folder / "fast", "-p", f"dt:={1e-9 * FAST}", period=FAST
    )
    click.echo(shown([new, bare]) + "\n")
    untold = float(new["missed"] > 0 and not new["warned"])
    return [
        kept("4 kHz", new, bare, 2.0, np.inf)[0],
        ("4 kHz: whether misses went untold", 0.0, untold),
    ]


def shares(name: str, new: Any, old: Any, worse: float) -> list[Line]:
    """Processor time and round trips, of those of an older tree."""
    return [
        (f"{name}: share of the sim, of the older one's", 0.55 * worse,
         new["share"] / old["share"]),
        (f"{name}: share of the controller, of the older one's", 0.4 * worse,
         new["controller"] / old["controller"]),
        (f"{name}: round trip p50, of the older one's", 0.85 * worse, new["trip"] / old["trip"]),
    ]  # fmt: skip


def kept(name: str, new: Any, bare: Any, misses: float, late: float) -> list[Line]:
    """Misses by ticks, of those of the bare thread, and p99 of the lateness."""
    rates = [r["missed"] / r["ticks"] for r in (new, bare)]
    ratio = rates[0] / max(rates[1], 1.0 / bare["ticks"])
    return [
        (f"{name}: misses, of the bare thread's", misses, ratio),
        (f"{name}: lateness p99, of the bare thread's", late, new["p99"] / bare["p99"]),
    ]


def services(folder: Path, records: dict[str, Any]) -> list[Line]:
    """Inverse dynamics of one point, in alternation with an empty service of rclpy."""
    domain = free_domain()
    os.environ |= {"ROS_DOMAIN_ID": str(domain), **as_usual()}
    with Processes(folder) as processes, ArmClient(timeout=60.0, domain=domain) as client:
        processes.start("dynamics", "dynamics", SCENE, "--with-parent")
        client.model_info()
        found = stages.one_point(domain, 5000, *np.full((3, Dynamics(SCENE).n), 0.3))
    records["services"] = found
    click.echo(f"services: {1e3 * found['p50']:.3f} ms, empty {1e3 * found['bare']['p50']:.3f}\n")
    return [("service p50, of rclpy's with an empty callback", 0.5,
             found["p50"] / found["bare"]["p50"])]  # fmt: skip


def lockstep(ticks: int, older: str, folder: Path, records: dict[str, Any]) -> list[Line]:
    """Both trees in lockstep across two processes, in turn."""
    found: dict[str, list[Any]] = {str(ROOT): [], older: []}
    for tree in [*found, *found, *found]:
        found[tree].append(_across(tree, ticks, folder))
    rates = {tree: float(np.median([r["rate"] for r in runs])) for tree, runs in found.items()}
    digests = {tree: [_across(tree, ticks, folder, "recorded")["digest"] for _ in range(2)]
               for tree in found}  # fmt: skip
    records["lockstep"] = found, digests
    rows = [(tree, f"{rates[tree]:,.0f}", ", ".join(digests[tree])) for tree in found]
    click.echo(table(("lockstep", "ticks/s, median of 3", "digests"), rows) + "\n")
    return [
        ("lockstep: ticks per second of the older tree, of the new one's", 1.0 / 1.5,
         rates[older] / rates[str(ROOT)]),
        ("lockstep: different digests of two runs", 1.0, float(len(set(digests[str(ROOT)])))),
    ]  # fmt: skip


def _across(tree: str, ticks: int, folder: Path, recorded: str = "") -> Any:
    domain, logs = free_domain(), folder / f"lockstep-{time.time_ns()}"
    logs.mkdir()
    words = [sys.executable, "-P", "-c", ACROSS, f"{tree}/src/arm_sim/arm_sim/scenes/panda.yaml",
             str(ticks), str(logs), str(domain), recorded]  # fmt: skip
    done = subprocess.run(
        words, env=surroundings(tree, domain), capture_output=True, text=True, check=False
    )
    for line in done.stdout.splitlines():
        if line.startswith("found "):
            return json.loads(line.removeprefix("found "))
    raise click.ClickException(f"lockstep of {tree}: {done.stderr[-2000:]}")


if __name__ == "__main__":
    main()
