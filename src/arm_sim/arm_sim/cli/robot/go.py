# SPDX-License-Identifier: Apache-2.0
"""``./arm go``: send a running arm to a goal, wait, and report the result."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, NamedTuple

import click

from arm_dynamics.exceptions import degrees_meant
from arm_sim.cli.arguments import File, NotNegative, Seconds, Timeout
from arm_sim.cli.command import command
from arm_sim.cli.output import number, progress, say
from arm_sim.cli.vectors import Vector, VectorType

if TYPE_CHECKING:
    from arm_sim.cli.robot.controller import Controller

PEAK = 1.875  # ratio of a quintic's peak speed to its mean
PEAK_SPEED = 1.0  # [rad/s] or [m/s], peak speed of a joint when no duration is given
SHORTEST_MOTION = 1.0  # [s], duration unless one is given
_GOAL = re.compile(r"(?P<name>[^=+]+?)(?P<operator>\+=|-=|=)(?P<number>.+)", re.DOTALL)
_OFFSET = 1e-6  # [rad] or [m] between reference and start without a motion to it
_SETTLING = 2.0  # [s] for the last errors to vanish once the reference is at rest
POSE = VectorType('"X Y Z QX QY QZ QW"', 7, "x y z in m and quaternion x y z w")


@command(
    "./arm go panda_joint4=-2.0",
    "./arm go panda_joint1+=0.3 panda_joint4=-2.0 --duration 4",
    './arm go --frame panda_hand --pose "0.4 0.2 0.5 1 0 0 0"',
    "./arm go shoulder=0.5 --controller left/controller",
    "./arm go --trajectory exciting.yaml",
)
def go(
    goals: Annotated[tuple[str, ...], "JOINT=POSITION…"] = (),
    *,
    duration: Seconds | None = None,
    pose: Annotated[Vector | None, POSE] = None,
    frame: str | None = None,
    trajectory: File | None = None,
    tolerance: NotNegative = 0.01,
    node: Annotated[str, "--controller"] = "controller",
    timeout: Timeout = 5.0,
    no_wait: bool = False,
) -> None:
    """Move the arm of a running controller to joint positions, or a frame to a pose.

    Joints that are not named do not move; JOINT+=X and JOINT-=X are relative to the current
    reference. The controller (./arm controller SCENE) and its robot (./arm sim SCENE) must be
    running. Exits with status 1 if the goal is refused or not reached.

    Args:
        duration: Duration of the motion, in s; by default, no joint is faster than 1 rad/s or 1
            m/s. The controller takes longer where limits require it.
        pose: Move a frame straight to a pose instead, in m; the quaternion has length 1.
        frame: Frame that --pose is of; else the controller's task_frame.
        trajectory: File of ./arm excite, or any JointTrajectory as YAML: move the joints to its
            start, then along it.
        tolerance: Largest joint error at which the goal is reached, in rad or m.
        node: Controller node, with its namespace.
        timeout: How long to wait for the controller and its states, in s.
        no_wait: Return when the motion has started.
    """
    joint_goals = parse(goals)
    if bool(joint_goals) + (pose is not None) + (trajectory is not None) != 1:
        raise click.UsageError("joint goals (JOINT=POSITION), --pose or --trajectory are expected")
    if pose is None and frame:
        raise click.UsageError("--frame is allowed with --pose only")
    if pose is not None and duration:
        raise click.UsageError(
            "--duration is for goals of joints; that of a motion to a pose follows from the "
            "controller's parameters cartesian_speed and cartesian_acceleration"
        )
    points = None
    if trajectory is not None:
        from arm_dynamics.trajectory.files import JointTrajectory

        points = JointTrajectory.load(trajectory)
    from arm_sim.cli.robot.controller import Controller

    with Controller(node, timeout) as controller:
        controller.wait_for_state()
        reference = controller.reference
        if pose is not None:
            task_frame, (numbers,) = controller.choose_frame(frame), pose.rows
            place = ", ".join(number(x, 4) for x in numbers[:3])
            description = f"{task_frame} straight to {place} m"
            send = partial(controller.send_pose, numbers)
        elif points is None:
            target = targets(joint_goals, reference)
            description, send = _joint_motion(controller, target, duration)
        else:
            if any(abs(x - reference.get(name, x)) > _OFFSET for name, x in points.start.items()):
                _follow(controller, *_joint_motion(controller, points.start, duration), tolerance)
            seconds = number(points.points[-1].time, 4)
            description = f"{len(points.points)} points in {seconds} s"
            send = partial(controller.send_trajectory, points.joint_names, points.points[1:])
        _follow(controller, description, send, tolerance, no_wait)


def _joint_motion(
    controller: Controller, target: dict[str, float], duration: float | None
) -> tuple[str, Callable[[], None]]:
    """Description of a motion of joints, and the function that sends it."""
    from arm_dynamics.trajectory.reference import Waypoint

    reference = controller.reference
    seconds = duration or unhurried(target, reference)
    start = {name: f"{number(x, 4)} " for name, x in reference.items()}  # not of mimic joints
    moves = [f"{name} {start.get(name, '')}→ {number(x, 4)}" for name, x in target.items()]
    description = f"{', '.join(moves)}, in {number(seconds, 3)} s"
    waypoints = [Waypoint(seconds, list(target.values()))]
    return description, partial(controller.send_trajectory, target, waypoints)


def _follow(
    controller: Controller, description: str, send: Callable[[], None], tolerance: float,
    no_wait: bool = False,
) -> None:  # fmt: skip
    """Send a goal, print its description once it is accepted, and follow the motion to its end."""
    outcome = controller.begin(send)
    say(description, *([outcome] if "slower" in outcome else []))
    if no_wait:
        return
    try:
        total = max(controller.remaining, 1e-9)
        with progress(sys.stdout) as show:
            for left in controller.motion():
                show(total=total, completed=total - min(left, total))
        joint, error = controller.settle(tolerance, _SETTLING)
    except KeyboardInterrupt:
        raise click.ClickException("no longer waiting; the arm continues to its goal") from None
    say(*controller.errors)
    if controller.replaced:
        cause = controller.outcome or "the controller holds the arm"
        if cause.startswith(("following", "planning")):
            cause = f"another goal has replaced it, {cause}"
        raise click.ClickException(f"goal not reached: {cause}")
    if not error <= tolerance:
        off, allowed = number(error, 3), number(tolerance, 3)
        raise click.ClickException(f"stopped short: {joint} is off by {off}, more than {allowed}")
    say(f"arrived: largest error {number(error, 2)} at {joint}")


class Goal(NamedTuple):
    """Of a joint."""

    value: float  # [rad] or [m]
    relative: bool  # to the current reference


def parse(words: Sequence[str]) -> dict[str, Goal]:
    """Goals of joints by name.

    Raises:
        click.UsageError: If a word is not a goal, or repeats a joint.
    """
    goals = dict[str, Goal]()
    for word in words:
        match = _GOAL.fullmatch(word.strip())
        try:
            value = float(match["number"]) if match else math.nan
        except ValueError:
            value = math.nan
        if match is None or not math.isfinite(value):
            raise click.UsageError(
                f"'{word}' is not a joint goal; allowed: JOINT=POSITION, JOINT+=DISTANCE and "
                "JOINT-=DISTANCE, with finite numbers in rad or m"
            )
        name, operator = match["name"], match["operator"]
        if name in goals:
            raise click.UsageError(f"joint '{name}' is named twice")
        if remark := degrees_meant(value):
            click.echo(f"{name}: {remark} (for a joint that slides, in m)", err=True)
        goals[name] = Goal(-value if operator == "-=" else value, relative=operator != "=")
    return goals


def targets(goals: Mapping[str, Goal], reference: Mapping[str, float]) -> dict[str, float]:
    """Target positions of the joints, from their current reference.

    The controller decides about joints that have none: they follow others, or do not exist.
    """
    return {
        name: goal.value + (reference.get(name, 0.0) if goal.relative else 0.0)
        for name, goal in goals.items()
    }


def unhurried(target: Mapping[str, float], reference: Mapping[str, float]) -> float:
    """A duration in [s] in which no joint gets faster than ``PEAK_SPEED``."""
    distances = (abs(target[name] - reference[name]) for name in target.keys() & reference)
    farthest = max(distances, default=0.0)
    return max(SHORTEST_MOTION, PEAK * farthest / PEAK_SPEED)
