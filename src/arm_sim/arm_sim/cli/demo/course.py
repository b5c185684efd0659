# SPDX-License-Identifier: Apache-2.0
"""The sequence of the demo: plan, start, observe, stop, report."""

import json
import os
import sys
import tempfile
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from rich.console import Console
from rich.progress import BarColumn, TimeElapsedColumn

from arm_dynamics import load_scene
from arm_dynamics.ros.common.transport import as_usual
from arm_sim.cli.demo import report
from arm_sim.cli.demo.motion import DemoMotion, choose_motion
from arm_sim.cli.demo.observer import Observations, Observer
from arm_sim.cli.demo.processes import DemoFailed, Processes, free_domain
from arm_sim.cli.output import console, progress, quiet, show
from arm_sim.recording import Recording
from arm_sim.view.server import library

_AFTER_MOTION = 0.3  # [s] of observation after the motion
_OPENING_TIME = 3.0  # [s] for a browser to open
_PRINT_PERIOD = 10.0  # [s] between lines of progress
_LONGEST_DELAY = 10.0  # [s] that the motion may take beyond one and a half times its duration
RECORDING = "run.mcap"


def run(robot: str, duration: float, output: Path, view: bool = False) -> None:
    """Run the demo, whose arguments ``demo`` explains.

    Raises:
        DemoFailed: If the loop was not closed.
        ArmError: If there is no motion for the arm.
    """
    if view:
        library()  # raises an error now if it is missing
    motion = choose_motion(load_scene(robot), duration)
    output.mkdir(parents=True, exist_ok=True)
    out = console()
    columns = ("{task.description}", BarColumn(), TimeElapsedColumn())
    with (
        tempfile.TemporaryDirectory(prefix="arm_demo_") as scratch,
        # A separate thread that refreshes it would disturb the measurement.
        progress(sys.stdout, _PrintedProgress(out).update, *columns, refresh=True) as on_progress,
    ):
        observations, clock = _run(motion, output, Path(scratch), on_progress, view)
        on_progress(description="checking the simulated motion by a second run")
        with quiet():
            verdict = Recording.load(Path(scratch) / RECORDING).verdict
    results = report.numbers(motion, observations, clock)
    _report(output, motion, observations, results, verdict, out)


class _PrintedProgress:
    """Prints, without a terminal, each step and, every ten seconds, how long it has taken."""

    def __init__(self, out: Console) -> None:
        self._out, self._began, self._printed = out, 0.0, 0.0

    def update(self, description: str = "", completed: float = 0.0, total: float = 1.0) -> None:
        now = time.monotonic()
        if description:
            self._began, self._printed, self._description = now, now, description
            self._out.print(f"{description} …")
        elif now > self._printed + _PRINT_PERIOD:
            self._printed = now
            self._out.print(f"  {self._description}: {now - self._began:.0f} s")


def _run(
    motion: DemoMotion, output: Path, scratch: Path, on_progress: Callable[..., object], view: bool
) -> tuple[Observations, dict[str, Any]]:
    """Execute the motion; return the observations and the sim node's report."""
    scene, timing, domain = scratch / "scene.yaml", scratch / "clock.json", free_domain()
    # A self-contained file for all three nodes.
    data = motion.model.scene.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    scene.write_text(yaml.safe_dump(data, allow_unicode=True), encoding="utf-8")

    def check() -> None:
        processes.check()
        on_progress(completed=observer.now(), total=motion.trajectory.duration)

    # For the child processes, which inherit it, and for the demo's own node.
    os.environ |= {"ROS_DOMAIN_ID": str(domain), **as_usual()}
    with Processes(output) as processes, Observer(motion.model.joint_names, check) as observer:
        on_progress(description=f"starting the nodes (ROS domain {domain}, this machine only)")
        node = str(scene), "--with-parent"
        processes.start("dynamics", "dynamics", *node)
        sparse = "--ros-args", "-p", "state_period:=0.01"
        processes.start("controller", "controller", *node, *sparse)
        observer.wait_for_partners()
        # Started last, so that no other start-up disturbs its timing.
        record = "--ros-args", "-p", f"record:={scratch / RECORDING}"
        processes.start("sim", "sim", *node, "--report", str(timing), *record)
        observer.wait_for_motion()
        place = f"; the view is at {_open_view(processes, scene)}" if view else ""
        on_progress(description=f"following the trajectory{place}")
        _follow(motion, processes, observer)
        on_progress(description="stopping the nodes")
        processes.stop("sim")
        processes.stop("view", "controller", "dynamics")
        if not timing.exists():
            log = processes.tail("sim")
            raise DemoFailed(f"the sim node did not end cleanly; its log says:\n{log}")
        return observer.observations(), json.loads(timing.read_text(encoding="utf-8"))


def _follow(motion: DemoMotion, processes: Processes, observer: Observer) -> None:
    """Send the motion, and wait until the arm has made it."""
    duration = motion.trajectory.duration
    patience = _LONGEST_DELAY + 1.5 * duration
    if not observer.send(motion.waypoints):
        raise DemoFailed(
            "the controller did not follow the trajectory; its log says:\n"
            + processes.tail("controller")
        )
    if not observer.until(lambda: observer.now() >= duration + _AFTER_MOTION, patience):
        raise DemoFailed(
            f"only {observer.now():.2f} s of the motion of {duration:g} s were seen within "
            f"{patience:g} s ({report.load()}); the simulator's log says:\n"
            + processes.tail("sim")
        )


def _open_view(processes: Processes, scene: Path) -> str:
    """Start a view that follows the arm, and a browser if there is one; return its address."""
    processes.start("view", "view", str(scene), "--live")
    while "(Ctrl-C ends)" not in (log := processes.log("view").read_text(errors="replace")):
        processes.check()
        time.sleep(0.1)
    address = next(word for word in log.split() if word.startswith("http://"))
    webbrowser.open(address)
    time.sleep(_OPENING_TIME)
    return address


def _report(
    output: Path, motion: DemoMotion, observations: Observations, n: report.Numbers, verdict: str,
    out: Console,
) -> None:  # fmt: skip
    """Write the figure and the numbers, and print a summary."""
    figure, file, model = output / "demo.png", output / "demo.json", motion.model
    report.draw(figure, observations, model.joint_names, model.joint_types, n)
    values = {"time": time.strftime("%Y-%m-%dT%H:%M:%S%z"), **n}
    file.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    show(out, report.result_table(n))
    out.print(f"motion:  {verdict}", soft_wrap=True, markup=False)
    out.print(f"figure:  {figure}\nnumbers: {file}", soft_wrap=True)
    if reasons := report.complaints(n):
        raise DemoFailed(f"{report.cause(n)}:\n  " + "\n  ".join(reasons))
    for remark in report.remarks(n):
        out.print(f"note: {remark}", markup=False)
