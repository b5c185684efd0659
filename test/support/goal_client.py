# SPDX-License-Identifier: Apache-2.0
"""A client of FollowJointTrajectory, and a controller node that receives states by hand."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from harness import Ros
from rclpy.action import ActionClient
from trajectory_msgs.msg import JointTrajectory
from two_link_control import MS, effort

from arm_dynamics.ros import ControllerNode

Goal = FollowJointTrajectory.Goal
Result = FollowJointTrajectory.Result
SUCCEEDED, CANCELED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED
ABORTED = GoalStatus.STATUS_ABORTED


def goal(trajectory: JointTrajectory, within: float = 0.0, **tolerances: Any) -> Any:
    """A goal with a tolerance of its time; ``path_tolerance``, ``goal_tolerance`` are lists."""
    made = Goal(trajectory=trajectory, **tolerances)
    seconds, nanoseconds = divmod(round(1e9 * within), 10**9)
    made.goal_time_tolerance.sec, made.goal_time_tolerance.nanosec = seconds, nanoseconds
    return made


def tolerance(name: str, position: float = 0.0, velocity: float = 0.0, **more: float) -> Any:
    return JointTolerance(name=name, position=position, velocity=velocity, **more)


class Client:
    """Sends goals and waits for what becomes of them."""

    def __init__(
        self, ros: Ros, name: str = "/controller/follow_joint_trajectory",
        kind: Any = FollowJointTrajectory,
    ) -> None:  # fmt: skip
        self._ros, self.feedback = ros, list[Any]()
        self._client = ActionClient(ros.peer, kind, name)
        ros.spin_until(self._client.server_is_ready)

    def begin(self, wanted: Any) -> Any:
        """Send a goal; returns the future of its handle."""
        hear = lambda message: self.feedback.append(message.feedback)  # noqa: E731
        return self._client.send_goal_async(wanted, feedback_callback=hear)

    def send(self, wanted: Any) -> Any:
        """Send a goal; returns its handle, which says whether it is accepted."""
        future = self.begin(wanted)
        self._ros.spin_until(future.done)
        return future.result()

    def result(self, handle: Any) -> tuple[int, Any]:
        """Wait for the result; returns the last status and the result."""
        future = handle.get_result_async()
        self._ros.spin_until(future.done)
        return future.result().status, future.result().result

    def cancel(self, handle: Any) -> int:
        """Cancel a goal; returns how many goals are being cancelled."""
        future = handle.cancel_goal_async()
        self._ros.spin_until(future.done)
        return len(future.result().goals_canceling)

    def close(self) -> None:
        self._client.destroy()


def led(
    node: ControllerNode,
    begin: int,
    end: int,
    off: Callable[[int], Sequence[float]] = lambda stamp: (0.0, 0.0),
    step: int = 10,
) -> None:
    """Show the node states from ``begin`` to ``end`` in [ms], an error off its reference."""
    for stamp in range(begin * MS, end * MS + 1, step * MS):
        there = node.goals.follower.reference(stamp)
        effort(node, stamp, there.q - np.asarray(off(stamp)), there.v)
