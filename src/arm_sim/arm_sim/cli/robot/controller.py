# SPDX-License-Identifier: Apache-2.0
"""A running controller node for ``./arm go``: its state, and goals for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Self

import click
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.interfaces import (
    CARTESIAN_GOAL,
    CONTROLLER_STATE,
    JOINT_STATES,
    JOINT_TRAJECTORY,
    Topic,
)
from arm_dynamics.trajectory import files
from arm_sim.cli.robot.listener import Listener, full
from arm_sim.cli.robot.parameters import Parameters
from arm_sim.cli.robot.reports import Reports

_JUMP = 0.05  # [s] by which the remaining time changes when a motion is replaced
_PLANNING = 30.0  # [s] timeout of planning
_SILENT = ": no joint state for"  # what is to be explained
_SAME = 1e-9  # [rad] or [m] tolerance between equal references


def _after(seconds: float) -> Duration:
    whole, part = divmod(round(1e9 * seconds), 1_000_000_000)
    return Duration(sec=whole, nanosec=part)


def _numbers(values: Any) -> list[float]:
    return [] if values is None else [float(x) for x in values]


class Controller:
    """Receives a controller's state and sends it goals; use it in a ``with`` statement."""

    def __init__(self, node: str, timeout: float) -> None:
        """Take the controller's name, and how long to wait for it in [s]."""
        self._name, self._timeout = full(node), timeout
        self._listener = Listener()
        self._state: Any = None
        self._count = 0
        self._target: Mapping[str, float] = {}
        self._listener.hear(CONTROLLER_STATE, self._topic(CONTROLLER_STATE), self._on_state)
        self._reports = Reports()
        self._reports.join(self._listener)

    def __enter__(self) -> Self:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the graph."""
        self._listener.__exit__()

    def _topic(self, topic: Topic) -> str:
        return topic.name.replace("~", self._name)

    def _on_state(self, state: Any) -> None:
        self._state, self._count = state, self._count + 1

    # --- its state ----------------------------------------------------------------------------

    @property
    def reference(self) -> dict[str, float]:
        """Current reference of the joints, by name in [rad] or [m]."""
        return dict(zip(self._state.joint_names, self._state.reference_position, strict=True))

    @property
    def remaining(self) -> float:
        """Simulated time until the accepted motions are finished, in [s]."""
        return float(self._state.remaining)

    @property
    def words(self) -> str:
        """Outcome of the newest goal, as reported by the controller."""
        return str(self._state.goal)

    @property
    def errors(self) -> list[str]:
        """What the nodes of this namespace report as errors."""
        return self._here(self._reports.errors)

    def _here(self, said: list[str]) -> list[str]:
        prefix = self._name.rpartition("/")[0].lstrip("/")
        return [line for line in said if line.startswith(prefix) and _SILENT not in line]

    @property
    def replaced(self) -> bool:
        """Whether the reference has ended at another position than the goal."""
        here, target = self.reference, self._target
        return any(abs(here[name] - x) > _SAME for name, x in target.items() if name in here)

    def meet(self) -> None:
        """Wait for the controller's state, or fail with what is missing."""
        if self._listener.until(lambda: self._state is not None, self._timeout):
            return
        listener, name = self._listener, self._name
        there = name in listener.nodes() or listener.publishers(self._topic(CONTROLLER_STATE))
        if there:
            raise click.ClickException(
                f"the controller {name} is there, but moves nothing: it has answered no joint "
                f"state for {self._timeout:g} s\n  {self._cause()}\n  {listener.where()}"
            )
        raise click.ClickException(
            f"no controller {name} (waited {self._timeout:g} s)\n  start one: ./arm controller "
            f"SCENE, and a robot: ./arm sim SCENE\n  {listener.where()}"
        )

    # --- goals ---------------------------------------------------------------------------------

    def choose_frame(self, frame: str | None) -> str:
        """The frame that poses are of, set if one is given."""
        with Parameters(self._name, self._timeout) as parameters:
            if frame is not None:
                parameters.set({"task_frame": frame})
            chosen = str(parameters.get(["task_frame"])["task_frame"])
        if not chosen:
            raise click.ClickException("the controller has no task_frame; set one with --frame")
        return chosen

    def send_joints(self, there: Mapping[str, float], duration: float) -> None:
        """Send joints to positions in [rad] or [m] within a duration in [s]."""
        point = JointTrajectoryPoint(positions=list(there.values()))
        point.time_from_start = _after(duration)
        self._target = there
        self._send(JOINT_TRAJECTORY, JointTrajectory(joint_names=list(there), points=[point]))

    def send_points(self, trajectory: files.JointTrajectory) -> None:
        """Send joints along a trajectory from its first point."""
        message = JointTrajectory(joint_names=list(trajectory.joint_names))
        for given in trajectory.points[1:]:
            point = JointTrajectoryPoint(time_from_start=_after(given.time))
            point.positions = _numbers(given.q)
            point.velocities, point.accelerations = _numbers(given.v), _numbers(given.a)
            point.effort = _numbers(given.tau)
            message.points.append(point)
        self._target = dict(zip(trajectory.joint_names, message.points[-1].positions, strict=True))
        self._send(JOINT_TRAJECTORY, message)

    def send_pose(self, numbers: Sequence[float]) -> None:
        """Send the task frame to x y z in [m] and a quaternion x y z w, in the world."""
        message = PoseStamped()
        at, turn = message.pose.position, message.pose.orientation
        at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w = map(float, numbers)
        self._send(CARTESIAN_GOAL, message)

    def _send(self, topic: Topic, message: Any) -> None:
        name = self._topic(topic)
        publisher = self._listener.publisher(topic, name)
        if not self._listener.until(lambda: publisher.get_subscription_count() > 0, self._timeout):
            raise click.ClickException(f"{name} has no subscriber (waited {self._timeout:g} s)")
        publisher.publish(message)

    def begin(self, send: Callable[[], None]) -> str:
        """Send a goal, and wait until the controller follows it; returns its message.

        Raises:
            ClickException: If it refuses the goal, or does not answer.
        """
        before, words = self._state, self.words
        send()

        def planned() -> bool:
            return not self.words.startswith("planning ") and (
                self.words != words or self._jumped(before)
            )

        if not self._listener.until(planned, _PLANNING):
            raise click.ClickException(
                f"no answer to the goal within {_PLANNING:g} s; {self.words}"
            )
        if "refused" in self.words:
            raise click.ClickException(self.words)
        return self.words

    def _jumped(self, before: Any) -> bool:
        """Whether more time remains than of the previous motion."""
        passed = 1e-9 * (
            to_nanoseconds(self._state.header.stamp) - to_nanoseconds(before.header.stamp)
        )
        return abs(self.remaining - max(before.remaining - passed, 0.0)) > _JUMP

    def motion(self) -> Iterator[float]:
        """Yield the remaining time of the motion in [s] until it is finished."""
        while self.remaining > 0.0:
            yield self.remaining
            self._next()

    def settle(self, tolerance: float, patience: float) -> tuple[str, float]:
        """Wait for the arm to come to rest at its reference.

        Args:
            tolerance: Of positions in [rad] or [m], and of velocities per [s].
            patience: Longest time to wait in [s].

        Returns:
            The joint with the largest error, and that error in [rad] or [m].
        """

        def at_rest() -> bool:
            fastest = max(map(abs, self._state.velocity_error))
            return max(self._error()[1], fastest) <= tolerance

        self._listener.until(at_rest, patience)
        return self._error()

    def _error(self) -> tuple[str, float]:
        errors = zip(map(abs, self._state.position_error), self._state.joint_names, strict=True)
        error, joint = max(errors)
        return str(joint), float(error)

    def _next(self) -> None:
        """Wait for the next state."""
        count = self._count
        if not self._listener.until(lambda: self._count > count, self._timeout):
            raise click.ClickException(
                f"no state of {self._name} for {self._timeout:g} s while the motion was under way"
                f"\n  {self._cause()}"
            )

    def _cause(self) -> str:
        """Why there are no states, as far as the nodes of this namespace report it."""
        space = self._name.rpartition("/")[0]
        topic, prefix = f"{space}/{JOINT_STATES.name}", space.lstrip("/")
        paused = self._reports.values("paused").items()
        if any(name.startswith(prefix) and x == "true" for name, x in paused):
            return "the simulation is paused; ./arm call resume ends that"
        if self._name not in self._listener.nodes():
            return "the controller has ended; start it again: ./arm controller SCENE"
        if not self._listener.publishers(topic):
            return f"nothing publishes {topic}; start a robot: ./arm sim SCENE"
        said = self._here(self._reports.complaints)
        return "\n  ".join(said) or f"{topic} has a publisher, but no state comes"
