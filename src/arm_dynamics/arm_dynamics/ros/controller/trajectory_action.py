# SPDX-License-Identifier: Apache-2.0
"""The action FollowJointTrajectory: accepts goals, monitors their execution and reports results.

It runs between two answers to joint states. The response to a goal waits for its plan, in a
coroutine that rclpy polls; nothing else waits.
"""

import asyncio
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectoryPoint

from arm_dynamics.control.controller import ArmState
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput, counted
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.ros.common.convert import to_array, to_time
from arm_dynamics.ros.common.diagnostics import Lateness
from arm_dynamics.ros.common.params import declare, watch
from arm_dynamics.ros.controller import action_goal
from arm_dynamics.ros.controller.action_goal import FollowParams, TrajectoryMessage
from arm_dynamics.ros.controller.goals import MOST_POINTS_AT_ONCE, Goal, Goals
from arm_dynamics.ros.controller.messages import waypoints
from arm_dynamics.ros.controller.tolerances import Tolerances, Verdict
from arm_dynamics.ros.interfaces import FOLLOW_JOINT_TRAJECTORY as ACTION
from arm_dynamics.trajectory.excess import Bounds
from arm_dynamics.trajectory.follower import Follower, Outset
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.reference import Motion, Reference, Waypoint
from arm_dynamics.trajectory.splines import spline, stretched_spline
from arm_dynamics.trajectory.trajectory import hold

_KIND = "action goal"
_RESULT_TIMEOUT = 60  # [s] for which results are kept for late clients
_LONGEST_WAIT = 3600.0  # [s] from the newest state to a goal's begin; beyond, clocks differ
_REACH = 0.01  # [rad] or [m] to a goal without time to move: a control error, no motion
_PREEMPTION = "Current goal preempted by new incoming action."
_TRAJECTORY = "Current goal cancelled due to new incoming trajectory."
_HOLD = "Current goal cancelled, the arm is held where it is."


class _Server(ActionServer):
    """An action server whose goals end when their monitor knows the result.

    rclpy's server runs an execute callback for each goal; here it runs when the result is known.
    """

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        if execute_callback is not None:
            super().notify_execute(goal_handle, execute_callback)


@dataclass
class ActiveGoal:
    """A goal that is being followed; stamps are in [ns]."""

    motion: Motion
    begin: int  # stamp at which the motion begins
    start: int  # stamp at which the goal's time is zero
    tolerances: Tolerances
    follower: Follower
    request: Any  # of the action's client
    handle: Any = None  # of the goal, once it is accepted
    next_feedback: int = 0
    next_check: int = 0  # until then only the path's tolerances are checked

    @property
    def end(self) -> int:
        """Stamp in [ns] from which the goal tolerances apply."""
        return self.begin + round(1e9 * self.motion.duration)

    @property
    def is_followed(self) -> bool:
        """Whether no other goal has replaced it."""
        return self.follower.newest[1] is self.motion


class TrajectoryAction:
    """Follows goals of the action ``~/follow_joint_trajectory``.

    Attributes:
        params: The parameters in force.
        active: The goal that is being followed, if there is one.
    """

    def __init__(
        self, node: Node, goals: Goals, model: ArmModel, limits: Limits,
        obstacle: Callable[[], str], lock: AbstractContextManager[None], lateness: Lateness,
    ) -> None:  # fmt: skip
        """Offer the action, if its interface is installed, and declare its parameters.

        Args:
            node: The controller.
            goals: Plans and follows trajectories.
            model: The arm.
            limits: Limits of its motion.
            obstacle: Returns the reason why the active controller follows no trajectories; empty
                if it does.
            lock: Held while goals change.
            lateness: Of the states; late ones explain errors.
        """
        self._node, self._goals, self._model, self._limits = node, goals, model, limits
        self._obstacle, self._lock, self._log = obstacle, lock, node.get_logger()
        self._lateness = lateness
        kinds = enumerate(model.joint_types)
        self._continuous = tuple(i for i, kind in kinds if kind == "continuous")
        self.active: ActiveGoal | None = None
        self._pending: ActiveGoal | None = None  # followed, its request to be accepted
        self._server: _Server | None = None
        self.params: FollowParams = declare(node, action_goal.follow_params(model.joint_names))
        watch(node, self.params, partial(setattr, self, "params"))
        if ACTION.type is None:
            self._log.warning("no action follow_joint_trajectory: control_msgs is not installed")
        else:
            self._server = _Server(
                node, ACTION.type, ACTION.name, lambda _: None,
                goal_callback=self._on_goal, handle_accepted_callback=self._on_accepted,
                cancel_callback=self._on_cancel, result_timeout=_RESULT_TIMEOUT,
            )  # fmt: skip

    def close(self) -> None:
        """End the action, before the node is destroyed."""
        if self._server is not None:
            self._server.destroy()

    def monitor(self, stamp: int, reference: Reference, state: ArmState) -> None:
        """Monitor the goal, after the answer to every joint state, whose stamp is in [ns]."""
        if (active := self.active) is None:
            return
        has_path_tolerances = not active.tolerances.path.is_none
        if self._goals.follower is not active.follower:
            self.abort(_HOLD)
        elif not active.is_followed:
            self.abort(_TRAJECTORY)
        elif stamp >= active.begin and (has_path_tolerances or stamp >= active.next_check):
            self._check(active, stamp, reference, state)

    def abort(self, reason: str) -> None:
        """Abort the active goal, if there is one, because it is no longer followed."""
        if self.active is not None:
            self._end("abort", "INVALID_GOAL", reason)

    def _check(
        self, active: ActiveGoal, stamp: int, reference: Reference, state: ArmState
    ) -> None:
        overdue = 1e-9 * (stamp - active.begin) - active.motion.duration
        verdict = active.tolerances.verdict(-overdue, reference, state)
        if stamp >= active.next_feedback or verdict is not None:
            active.next_feedback = stamp + round(1e9 / self.params.action_monitor_rate)
            active.next_check = min(active.next_feedback, active.end)
            active.handle.publish_feedback(self._feedback(active, stamp, reference, state))
        if verdict is Verdict.REACHED:
            self._end("succeed", "SUCCESSFUL", "Goal successfully reached!")
        elif verdict is not None:
            self._lateness.update()  # late states may be the cause
            farthest = active.tolerances.worst(verdict, self._model.joint_names, reference, state)
            self._log.warning("; ".join(filter(None, (farthest, self._lateness.message))))
            self._goals.brake(Reference(state.q, state.v, np.zeros_like(state.q), reference.tau))
            code, why = "PATH_TOLERANCE_VIOLATED", "Aborted due to path tolerance violation"
            if verdict is Verdict.MISSED_GOAL:
                code = "GOAL_TOLERANCE_VIOLATED"
                why = f"Aborted due to goal_time_tolerance exceeding by {overdue:f} seconds"
            self._end("abort", code, why)

    def _feedback(
        self, goal: ActiveGoal, stamp: int, reference: Reference, state: ArmState
    ) -> Any:
        message = ACTION.type.Feedback(joint_names=list(self._model.joint_names))
        message.header.stamp = to_time(stamp)
        errors = goal.tolerances.errors(reference, state)
        message.desired = _point(reference.q, reference.v, reference.a)
        message.actual, message.error = _point(state.q, state.v), _point(*errors)
        since = to_time(stamp - goal.start)
        for point in (message.desired, message.actual, message.error):
            point.time_from_start.sec, point.time_from_start.nanosec = since.sec, since.nanosec
        return message

    def _end(self, event: str, code: str, why: str) -> None:
        active, self.active = self.active, None
        self._publish_result(active.handle, event, code, why)

    def _publish_result(self, handle: Any, event: str, code: str, why: str) -> None:
        result = ACTION.type.Result(error_string=why)
        result.error_code = getattr(ACTION.type.Result, code)
        getattr(handle, event)()
        self._server.notify_execute(handle, lambda _: result)
        self._goals.outcome = why or "action goal cancelled, the arm is held"
        self._log.info(self._goals.outcome)

    async def _on_goal(self, goal: Any) -> GoalResponse:
        """Accept a goal once it is followed, or report why not."""
        accepted = Future()
        try:
            with self._lock:
                self._begin(goal, accepted)
        except Exception as error:
            why = error if isinstance(error, InvalidInput) else f"unexpected failure: {error!r}"
            self._goals.refuse(_KIND, f"{self._goals.continuation}: {why}")
            return GoalResponse.REJECT
        planner = self._goals.planner
        while not accepted.done() and planner.busy:
            await asyncio.sleep(0)  # a turn of the other callbacks
            with self._lock:
                planner.deliver()
        if not accepted.done():
            self._goals.refuse(_KIND, ": a newer goal came while it was being planned")
        return GoalResponse.ACCEPT if accepted.result() else GoalResponse.REJECT

    def _begin(self, goal: Any, accepted: Future) -> None:
        """Plan a goal and follow it; whether it is followed is the result of ``accepted``."""
        if why := self._obstacle():
            raise InvalidInput(why)
        action_goal.refuse_multi_dof(goal)
        params, names = self.params, self._model.joint_names
        message = TrajectoryMessage(goal.trajectory, names, params.allow_partial_joints_goal)
        allowed = action_goal.tolerances(goal, params, names, self._continuous)
        if message.stamp and 1e-9 * (message.stamp - self._goals.stamp) > _LONGEST_WAIT:
            raise InvalidInput(
                f"header.stamp is {1e-9 * message.stamp:.3f} s and the newest joint state "
                f"{1e-9 * self._goals.stamp:.3f} s; allowed: stamps of the same clock"
            )

        def on_planned(motion: Motion | None) -> None:
            if motion is not None:
                self.abort(_PREEMPTION)
                follower = self._goals.follower
                begin = follower.newest[0]
                start = message.stamp or begin
                self._pending = ActiveGoal(motion, begin, start, allowed, follower, goal)
            accepted.set_result(motion is not None)

        plan = partial(self._plan, message, params)
        about = counted(message.count, "point")
        at_once = message.count <= MOST_POINTS_AT_ONCE
        stamp = message.stamp or None
        self._goals.follow(Goal(_KIND, about, stamp, plan, on_planned), at_once=at_once)

    def _plan(self, message: TrajectoryMessage, params: FollowParams, outset: Outset) -> Motion:
        """Plan a goal, perhaps in the planner's thread."""
        message.check_points()
        points = waypoints(message, self._model.joint_names, outset.reference)
        points = self._unwound(points, outset.reference)
        if message.stamp == 0 and points[-1].time == 0.0:
            return _zero_duration_motion(outset.reference, points[-1])
        ahead = outset.remaining(points)
        bounds = Bounds(self._limits, Dynamics(self._model), params.limit_margin)
        if params.stretch_goals:
            motion = stretched_spline(ahead, bounds.factor)
        else:
            motion = spline(ahead)
        bounds.check(motion, outset.lag, outset.reference.v)
        return motion

    def _unwound(self, points: list[Waypoint], here: Reference) -> list[Waypoint]:
        """The points shifted by revolutions of continuous joints, the first to the nearest."""
        if not self._continuous:
            return points
        turns, joints = np.zeros_like(here.q), list(self._continuous)
        turns[joints] = np.round((here.q - np.asarray(points[0].q))[joints] / (2.0 * np.pi))
        return [replace(p, q=np.asarray(p.q) + 2.0 * np.pi * turns) for p in points]

    def _on_accepted(self, handle: Any) -> None:
        with self._lock:
            pending = self._pending
            handle.execute()
            if pending is None or pending.request is not handle.request or not pending.is_followed:
                self._publish_result(handle, "abort", "INVALID_GOAL", _PREEMPTION)
                return
            self._pending, self.active, pending.handle = None, pending, handle

    def _on_cancel(self, handle: Any) -> CancelResponse:
        self._node.executor.create_task(self._cancelled, handle)  # after the response
        return CancelResponse.ACCEPT

    def _cancelled(self, handle: Any) -> None:
        with self._lock:
            if not handle.is_cancel_requested:
                return
            if self.active is not None and self.active.handle == handle:
                self.active = None
                self._goals.brake()
            self._publish_result(handle, "canceled", "SUCCESSFUL", "")


def _zero_duration_motion(here: Reference, to: Waypoint) -> Motion:
    """A motion of zero duration to a point that the arm has reached up to a control error.

    Raises:
        InvalidInput: If the point is farther away.
    """
    far = float(np.max(np.abs(np.asarray(to.q) - here.q)))
    if far > _REACH:
        raise InvalidInput(
            f"the last point, at 0 s, is {far:.4g} away; allowed: {_REACH} without time to move"
        )
    return hold(to.q, to.tau)


def _point(positions: Any, velocities: Any, accelerations: Any = ()) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(
        positions=to_array(positions), velocities=to_array(velocities),
        accelerations=to_array(accelerations),
    )  # fmt: skip
