# SPDX-License-Identifier: Apache-2.0
"""``./arm go``: send a running arm to a goal, wait, and report the result."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.output import console, examples, number
from arm_sim.cli.robot.goal import JointGoal, parse, targets, unhurried
from arm_sim.cli.vectors import Vector, VectorType

if TYPE_CHECKING:
    from arm_dynamics.trajectory.files import JointTrajectory
    from arm_sim.cli.robot.controller import Controller

_THERE = 1e-6  # [rad] or [m] between reference and start without a motion to it
_SETTLING = 2.0  # [s] for the last errors to vanish once the reference is at rest


@click.command(
    epilog=examples(
        "./arm go panda_joint4=-2.0",
        "./arm go panda_joint1+=0.3 panda_joint4=-2.0 --duration 4",
        './arm go --frame panda_hand --pose "0.4 0.2 0.5 1 0 0 0"',
        "./arm go shoulder=0.5 --controller left/controller",
        "./arm go --trajectory exciting.yaml",
    )
)
@click.argument("goals", metavar="JOINT=POSITION…", nargs=-1)
@click.option("--duration", type=click.FloatRange(0.0, 3600.0, min_open=True),
              help="Duration of the motion, in s; by default, no joint is faster than 1 rad/s "
              "or 1 m/s. The controller takes longer where limits require it.")  # fmt: skip
@click.option("--pose", type=VectorType(), metavar='"X Y Z QX QY QZ QW"',
              help="Move a frame straight to a pose instead, in m; the quaternion has length "
              "1.")  # fmt: skip
@click.option("--frame", help="Frame that --pose is of; else the controller's task_frame.")
@click.option("--trajectory", type=click.Path(dir_okay=False, path_type=Path),
              help="File of ./arm excite, or any JointTrajectory as YAML: move the joints to its "
              "start, then along it.")  # fmt: skip
@click.option("--tolerance", default=0.01, show_default=True, type=click.FloatRange(0.0),
              help="Largest joint error at which the goal is reached, in rad or m.")  # fmt: skip
@click.option("--controller", "node", default="controller", show_default=True,
              help="Controller node, with its namespace.")  # fmt: skip
@click.option("--timeout", default=5.0, show_default=True, type=click.FloatRange(0.1),
              help="How long to wait for the controller and its states, in s.")  # fmt: skip
@click.option("--no-wait", is_flag=True, help="Return when the motion has started.")
def go(
    goals: tuple[str, ...], duration: float | None, pose: Vector | None, frame: str | None,
    trajectory: Path | None, tolerance: float, node: str, timeout: float, no_wait: bool,
) -> None:  # fmt: skip
    """Move the arm of a running controller to joint positions, or a frame to a pose.

    Joints that are not named do not move; JOINT+=X and JOINT-=X are relative to the current
    reference. The controller (./arm controller SCENE) and its robot (./arm sim SCENE) must be
    running. Exits with status 1 if the goal is refused or not reached.
    """
    wanted = parse(goals)
    numbers = _pose(pose)
    if bool(wanted) + (numbers is not None) + (trajectory is not None) != 1:
        raise click.UsageError(
            "joint goals (JOINT=POSITION), --pose, or --trajectory are expected"
        )
    points = None if trajectory is None else _loaded(trajectory)
    if numbers is None and frame:
        raise click.UsageError("--frame is allowed with --pose only")
    if numbers is not None and duration:
        raise click.UsageError(
            "--duration is for goals of joints; that of a motion to a pose follows from the "
            "controller's parameters cartesian_speed and cartesian_acceleration"
        )
    from arm_sim.cli.robot.controller import Controller

    with Controller(node, timeout) as controller:
        controller.meet()
        if points is not None:
            _along(controller, points, duration, tolerance, no_wait)
            return
        if numbers is None:
            send = _joint_motion(controller, wanted, duration)
        else:
            send = _straight_line(controller, numbers, frame)
        _lead(controller, send, tolerance, no_wait)


def _pose(given: Vector | None) -> list[float] | None:
    """Seven numbers, the quaternion of length one."""
    if given is None:
        return None
    numbers = list(given.rows[0]) if len(given.rows) == 1 else []
    if len(numbers) != 7:
        raise click.UsageError("--pose: 7 numbers are expected, x y z in m and quaternion x y z w")
    return numbers


def _joint_motion(
    controller: Controller, wanted: tuple[JointGoal, ...], duration: float | None
) -> Callable[[], None]:
    here = controller.reference
    there = targets(wanted, here)
    seconds = duration or unhurried(there, here)
    known = {name: x for name, x in there.items() if name in here}
    what = [f"{name} {number(here[name], 4)} → {number(x, 4)}" for name, x in known.items()]
    if what:
        console().print(f"{', '.join(what)}, in {number(seconds, 3)} s", markup=False)
    return lambda: controller.send_joints(there, seconds)


def _straight_line(
    controller: Controller, numbers: list[float], frame: str | None
) -> Callable[[], None]:
    chosen = controller.choose_frame(frame)
    console().print(f"{chosen} straight to {', '.join(number(x, 4) for x in numbers[:3])} m",
                    markup=False)  # fmt: skip
    return lambda: controller.send_pose(numbers)


def _loaded(path: Path) -> JointTrajectory:
    from arm_dynamics.trajectory.files import JointTrajectory

    return JointTrajectory.load(path)


def _along(
    controller: Controller,
    points: JointTrajectory,
    duration: float | None,
    tolerance: float,
    no_wait: bool,
) -> None:
    """Move the joints to the start of a trajectory, and then along it."""
    here, there = controller.reference, points.start
    if any(abs(there[name] - here.get(name, there[name])) > _THERE for name in there):
        start = tuple(JointGoal(name, x, relative=False) for name, x in there.items())
        _lead(controller, _joint_motion(controller, start, duration), tolerance, no_wait=False)
    seconds = number(points.points[-1].time, 4)
    console().print(f"{len(points.points)} points in {seconds} s", markup=False)
    _lead(controller, lambda: controller.send_points(points), tolerance, no_wait)


def _lead(
    controller: Controller, send: Callable[[], None], tolerance: float, no_wait: bool
) -> None:
    """Send a goal and follow the motion to its end."""
    words = controller.begin(send)
    if "slower" in words:
        console().print(words, markup=False)
    if no_wait:
        return
    try:
        _follow(controller)
        joint, error = controller.settle(tolerance, _SETTLING)
    except KeyboardInterrupt:
        raise click.ClickException("no longer waiting; the arm continues to its goal") from None
    for complaint in controller.errors:
        console().print(complaint, markup=False)
    if controller.replaced:
        words = controller.words or "the controller holds the arm"
        another = words.startswith(("following", "planning"))
        cause = f"another goal has replaced it, {words}" if another else words
        raise click.ClickException(f"goal not reached: {cause}")
    if not error <= tolerance:
        off, allowed = number(error, 3), number(tolerance, 3)
        raise click.ClickException(f"stopped short: {joint} is off by {off}, more than {allowed}")
    console().print(f"arrived: largest error {number(error, 2)} at {joint}", markup=False)


def _follow(controller: Controller) -> None:
    """Show the progress of a motion until it is finished."""
    whole = max(controller.remaining, 1e-9)
    with _progress() as show:
        for left in controller.motion():
            show(1.0 - min(left / whole, 1.0))


@contextmanager
def _progress() -> Iterator[Callable[[float], None]]:
    """Show the progress of a motion on a terminal."""
    if not sys.stdout.isatty():
        yield lambda done: None
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn

    columns: Any = (BarColumn(), TaskProgressColumn())
    with Progress(*columns, transient=True) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda done: progress.update(task, completed=done)
