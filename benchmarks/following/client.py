# SPDX-License-Identifier: Apache-2.0
"""A client that treats the action as MoveIt's controller manager does.

Only the trajectory of a goal is filled in; its start must be within 0.01 rad of a joint state that
is no older than the question; and a goal that takes longer than 1.1 times its duration and half a
second is cancelled. Source: MoveIt 2, moveit_simple_controller_manager and
trajectory_execution_manager (``allowed_start_tolerance``, ``allowed_execution_duration_scaling``,
``allowed_goal_duration_margin``), ``CurrentStateMonitor::waitForCurrentState``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from arm_dynamics.arrays import Array
from benchmarks.following.rig import Rig

START_TOLERANCE = 0.01  # [rad]
SCALING, MARGIN = 1.1, 0.5  # of the duration, and [s]
FRESH = 1.0  # [s] to wait for a fresh state
_PATIENCE = 5.0  # [s] for an answer
_NAMES = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "cancelled",
    GoalStatus.STATUS_ABORTED: "aborted",
}


class Failed(Exception):
    """What MoveIt would say of a goal that it does not get."""


@dataclass
class Sent:
    """A goal under way.

    Attributes:
        handle: The action's goal.
        result: Future of its result.
        due: Time in [s] at which it is cancelled.
        began: Time in [s] at which it was accepted.
    """

    handle: Any
    result: Any
    due: float
    began: float


class MoveItClient:
    """Sends trajectories and waits for what becomes of them.

    Attributes:
        feedback: How many messages of feedback came.
    """

    def __init__(
        self,
        node: Node,
        names: Sequence[str],
        spin_once: Callable[[], None],
        rig: Rig | None = None,
    ) -> None:
        """Find the action.

        Args:
            node: Whose name it acts in.
            names: The joints.
            spin_once: Runs callbacks for a moment.
            rig: Whose time it lets pass; None where time passes by itself, by the node's clock.
        """
        self._node, self._names, self._spin, self._rig = node, list(names), spin_once, rig
        self._state: JointState | None = None
        self.feedback = 0
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(JointState, "joint_states", self._take, newest)
        name = "controller/follow_joint_trajectory"
        self._action = ActionClient(node, FollowJointTrajectory, name)

    def _take(self, message: JointState) -> None:
        self._state = message

    @property
    def now(self) -> float:
        """Present time in [s]."""
        if self._rig is not None:
            return self._stamp
        return 1e-9 * float(self._node.get_clock().now().nanoseconds)

    @property
    def _stamp(self) -> float:
        if self._state is None:
            return -1.0
        stamp = self._state.header.stamp
        return float(stamp.sec) + 1e-9 * float(stamp.nanosec)

    def connect(self, tries: int) -> None:
        """Wait for states and the action."""
        for _ in range(tries):
            self._pass_time()
            if self._state is not None and self._action.server_is_ready():
                return
        raise Failed("no joint states, or no action server")

    def fresh(self) -> tuple[Array, Array]:
        """Positions and velocities of a state that is no older than this call."""
        asked = self.now
        while self._stamp < asked:
            if self.now > asked + FRESH:
                late = f"{asked - self._stamp:.3f} s older than the question"
                raise Failed(f"no current robot state within {FRESH} s: the newest is {late}")
            self._pass_time()
        assert self._state is not None
        at = [self._state.name.index(name) for name in self._names]
        return np.array(self._state.position)[at], np.array(self._state.velocity)[at]

    def check_start(self, start: Array) -> float:
        """How far the arm is from the start of a trajectory in [rad]."""
        far = float(np.abs(self.fresh()[0] - start).max())
        if far > START_TOLERANCE:
            raise Failed(f"start point deviates from current robot state by {far:.4g} rad")
        return far

    def send(self, trajectory: JointTrajectory, duration: float) -> Sent:
        """Send a goal with nothing but a trajectory."""
        goal = FollowJointTrajectory.Goal(trajectory=trajectory)
        asked = self._action.send_goal_async(goal, feedback_callback=self._hear)
        handle = self._answer(asked)
        if not handle.accepted:
            raise Failed("goal was rejected by server")
        now = self.now
        return Sent(handle, handle.get_result_async(), now + SCALING * duration + MARGIN, now)

    def wait(self, sent: Sent, expected: int = GoalStatus.STATUS_SUCCEEDED) -> float:
        """Wait for the result; returns how long the goal took in [s]."""
        self._until(sent.result.done, sent.due)
        if not sent.result.done():
            self.cancel(sent)
            raise Failed("controller is taking too long to execute trajectory")
        answer = sent.result.result()
        if answer.status != expected:
            name = _NAMES.get(answer.status, str(answer.status))
            raise Failed(
                f"goal {name} with {answer.result.error_code} '{answer.result.error_string}'"
            )
        return self.now - sent.began

    def cancel(self, sent: Sent) -> None:
        """Cancel a goal and wait until the server has taken note."""
        asked = sent.handle.cancel_goal_async()
        if not self._answer(asked).goals_canceling:
            raise Failed("the goal could not be cancelled")

    def pause(self, seconds: float) -> None:
        """Let time pass."""
        self._until(lambda: False, self.now + seconds)

    def _hear(self, _: Any) -> None:
        self.feedback += 1

    def _until(self, done: Callable[[], bool], end: float) -> None:
        while not done() and self.now < end:
            self._pass_time()

    def _pass_time(self) -> None:
        if self._rig is not None:
            self._rig.advance()
            self._state = self._rig.state
        self._spin()

    def _answer(self, asked: Any) -> Any:
        """What the server says at once, in no time of a rig."""
        end = time.monotonic() + _PATIENCE
        while not asked.done():
            if time.monotonic() > end:
                raise Failed("no answer from the action server")
            self._spin()
        return asked.result()
