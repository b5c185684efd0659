# SPDX-License-Identifier: Apache-2.0
"""A running controller node for ``./arm go``: its state, and goals for it."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import click
from geometry_msgs.msg import PoseStamped

from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.trajectory.reference import Waypoint
from arm_sim.cli.robot.listener import Listener, full, trajectory_message
from arm_sim.cli.robot.node_parameters import Parameters
from arm_sim.cli.robot.reports import ERROR, Reports

_LEAST_JUMP = 0.05  # [s] by which the remaining time changes when a motion is replaced
_PLANNING = 30.0  # [s] timeout of planning
_SILENCE = ": no joint state for"  # a symptom, whose cause is reported instead
_TOLERANCE = 1e-9  # [rad] or [m] tolerance between equal references


class Controller(Listener):
    """Receives a controller's state and sends it goals; use it in a ``with`` statement.

    Args:
        node: The controller's name.
        timeout: How long to wait for it in [s].
    """

    def __init__(self, node: str, timeout: float) -> None:
        super().__init__()
        self._name, self._timeout = full(node), timeout
        self._space = self._name.rpartition("/")[0]
        self._state: Any = None
        self._count = 0
        self._target: Mapping[str, float] = {}
        self._reports = Reports()
        self._reports.join(self)
        topic = interfaces.CONTROLLER_STATE
        self.subscribe(topic, self._topic(topic), self._on_state)

    def _topic(self, topic: interfaces.Topic) -> str:
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
    def outcome(self) -> str:
        """Outcome of the newest goal, as reported by the controller."""
        return str(self._state.goal)

    @property
    def errors(self) -> list[str]:
        """What the nodes of this namespace report as errors."""
        return self._of_namespace(self._reports.complaints(ERROR))

    def _of_namespace(self, reports: list[str]) -> list[str]:
        prefix = self._space.lstrip("/")
        return [line for line in reports if line.startswith(prefix) and _SILENCE not in line]

    @property
    def replaced(self) -> bool:
        """Whether the reference has ended at another position than the goal."""
        reference, goal = self.reference, self._target.items()
        return any(abs(reference[name] - x) > _TOLERANCE for name, x in goal if name in reference)

    def wait_for_state(self) -> None:
        """Wait for the controller's state, or fail with what is missing."""
        if self.until(lambda: self._state is not None, self._timeout):
            return
        if self._name in self.nodes() or self.publishers(self._topic(interfaces.CONTROLLER_STATE)):
            raise click.ClickException(
                f"the controller {self._name} is there, but moves nothing: it has answered no "
                f"joint state for {self._timeout:g} s\n  {self._cause()}\n  {self.where()}"
            )
        raise click.ClickException(
            f"no controller {self._name} (waited {self._timeout:g} s)\n  start one: ./arm "
            f"controller SCENE, and a robot: ./arm sim SCENE\n  {self.where()}"
        )

    # --- goals ---------------------------------------------------------------------------------

    def choose_frame(self, frame: str | None) -> str:
        """The frame that poses are of, set if one is given."""
        with Parameters(self._name, self._timeout) as parameters:
            if frame is not None:
                parameters.set({"task_frame": frame})
            task_frame = str(parameters.get(["task_frame"])["task_frame"])
        if not task_frame:
            raise click.ClickException("the controller has no task_frame; set one with --frame")
        return task_frame

    def send_trajectory(self, names: Iterable[str], waypoints: Sequence[Waypoint]) -> None:
        """Send joints from where they are through waypoints."""
        message = trajectory_message(names, waypoints)
        self._target = dict(zip(message.joint_names, message.points[-1].positions, strict=True))
        self._send(interfaces.JOINT_TRAJECTORY, message)

    def send_pose(self, numbers: Sequence[float]) -> None:
        """Send the task frame to x y z in [m] and a quaternion x y z w, in the world."""
        message = PoseStamped()
        x, q = message.pose.position, message.pose.orientation
        x.x, x.y, x.z, q.x, q.y, q.z, q.w = map(float, numbers)
        self._send(interfaces.CARTESIAN_GOAL, message)

    def _send(self, topic: interfaces.Topic, message: Any) -> None:
        name = self._topic(topic)
        publisher = self.publisher(topic, name)
        if not self.until(lambda: publisher.get_subscription_count() > 0, self._timeout):
            raise click.ClickException(f"{name} has no subscriber (waited {self._timeout:g} s)")
        publisher.publish(message)

    def begin(self, send: Callable[[], None]) -> str:
        """Send a goal, and wait until the controller follows it; returns its message.

        Raises:
            ClickException: If it refuses the goal, or does not answer.
        """
        before, outcome = self._state, self.outcome
        start = to_nanoseconds(before.header.stamp)
        send()

        def is_planned() -> bool:
            if self.outcome.startswith("planning "):
                return False
            # The same outcome may be of another motion, which has more time left.
            passed = 1e-9 * (to_nanoseconds(self._state.header.stamp) - start)
            left = max(before.remaining - passed, 0.0)
            return self.outcome != outcome or abs(self.remaining - left) > _LEAST_JUMP

        if not self.until(is_planned, _PLANNING):
            raise click.ClickException(f"no answer to the goal in {_PLANNING:g} s; {self.outcome}")
        if "refused" in self.outcome:
            raise click.ClickException(self.outcome)
        return self.outcome

    def motion(self) -> Iterator[float]:
        """Yield the remaining time of the motion in [s] until it is finished."""
        while self.remaining > 0.0:
            yield self.remaining
            if not self.until(lambda count=self._count: self._count > count, self._timeout):
                raise click.ClickException(
                    f"no state of {self._name} for {self._timeout:g} s while the motion was under "
                    f"way\n  {self._cause()}"
                )

    def settle(self, tolerance: float, patience: float) -> tuple[str, float]:
        """Wait for the arm to come to rest at its reference.

        Args:
            tolerance: Of positions in [rad] or [m], and of velocities per [s].
            patience: Longest time to wait in [s].

        Returns:
            The joint with the largest error, and that error in [rad] or [m].
        """

        def largest() -> tuple[float, str]:
            state = self._state
            return max(zip(map(abs, state.position_error), state.joint_names, strict=True))

        def at_rest() -> bool:
            return max(largest()[0], *map(abs, self._state.velocity_error)) <= tolerance

        self.until(at_rest, patience)
        error, joint = largest()
        return str(joint), float(error)

    def _cause(self) -> str:
        """Why there are no states, as far as the nodes of this namespace report it."""
        topic, prefix = f"{self._space}/{interfaces.JOINT_STATES.name}", self._space.lstrip("/")
        paused = self._reports.values("paused").items()
        if any(name.startswith(prefix) and x == "true" for name, x in paused):
            return "the simulation is paused; ./arm call resume ends that"
        if self._name not in self.nodes():
            return "the controller has ended; start it again: ./arm controller SCENE"
        if not self.publishers(topic):
            return f"nothing publishes {topic}; start a robot: ./arm sim SCENE"
        complaints = self._of_namespace(self._reports.complaints())
        return "\n  ".join(complaints) or f"{topic} has a publisher, but no state comes"
