# SPDX-License-Identifier: Apache-2.0
"""The controller node: leads an arm along joint trajectories by a law of one's choice."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from arm_dynamics.actuation.command_map import rigid_twin
from arm_dynamics.arrays import Array, finite_numbers
from arm_dynamics.control.computed_torque import Checked, Measured
from arm_dynamics.control.factory import (
    IN_TASK_SPACE,
    Job,
    Settings,
    make_controller,
    preparation,
)
from arm_dynamics.control.wrappers import AnyController, Saturated, Switch
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ArmError, InvalidInput
from arm_dynamics.ros.common import convert
from arm_dynamics.ros.common.answer_log import AnswerLog
from arm_dynamics.ros.common.background import Background, take_short_turns
from arm_dynamics.ros.common.cdr import as_bytes
from arm_dynamics.ros.common.diagnostics import Diagnosis, Finding
from arm_dynamics.ros.common.direct import sender
from arm_dynamics.ros.common.executor import run, surviving
from arm_dynamics.ros.common.params import (
    ControllerParams,
    declare,
    privileges,
    task_axes,
    watch,
)
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.ros.controller.settings import settings_of
from arm_dynamics.ros.interfaces import (
    CARTESIAN_GOAL,
    CARTESIAN_PATH,
    CONTROLLER_STATE,
    JOINT_COMMANDS,
    JOINT_STATES,
    JOINT_TRAJECTORY,
)
from arm_dynamics.ros.joint_state.compiled import make_reader
from arm_dynamics.ros.joint_state.serialization import JointStateWriter
from arm_dynamics.scene.load import load_scene
from arm_dynamics.task_space.task_space import TaskSpace
from arm_dynamics.trajectory.follower import Follower
from arm_dynamics.trajectory.reference import Limits, Reference

_THROTTLE = 2.0  # [s] between warnings of one kind
_FREE = "float"  # the law under which the arm is led by hand, away from its reference


class ControllerNode(Node):
    """Answers every joint state with a joint command.

    It stands still where it first sees the arm, and where it sees it after time went backwards,
    until a trajectory, a pose or a path comes. Time is that of the states' stamps. The law may be
    changed in motion.
    """

    def __init__(self, scene: Any = None, **node_kwargs: Any) -> None:
        """Start the node.

        Args:
            scene: Anything ``load_scene`` takes; the parameter ``scene`` when None.
            **node_kwargs: For ``rclpy.node.Node``: context, namespace, parameter_overrides, …

        Raises:
            ArmError: If there is no scene, or a scene or parameter that cannot be used.
        """
        super().__init__("controller", **node_kwargs)
        self._params = declare(self, ControllerParams)
        scene = scene if scene is not None else self._params.scene or None
        if scene is None:
            raise InvalidInput("parameter 'scene' is empty; allowed is a scene file or a URDF")
        self._dynamics = Dynamics(rigid_twin(load_scene(scene)))
        names = self._dynamics.joint_names
        period, fade = self._params.control_period, self._params.switch_time
        self._control = Switch(self._made(self._params), period, fade)
        self._builder = Background("builder")
        model = self._dynamics.model
        self._build_ahead(self._params)
        limit = self._params.acceleration_limit or float("inf")
        self._goals = Goals(model, Limits.of(model, limit), self.get_logger())
        self._next_report = 0
        self._reader = make_reader(names, ("position", "velocity"), partial=False, extra=True)
        me = f"{self.get_fully_qualified_name()}:{os.getpid()}"  # tells two controllers apart
        self._writer = JointStateWriter(names, ("effort",), frame_id=me)
        self._log = AnswerLog()
        self._connect()
        watch(self, lambda: self._params, self._apply)
        self._diagnosis = Diagnosis(self, self._findings)
        for refusal in privileges(self._params).claim():
            self.get_logger().warning(f"not granted: {refusal}")

    def _connect(self) -> None:
        self._send = sender(self, JOINT_COMMANDS)
        self._report = self.create_publisher(
            CONTROLLER_STATE.type, CONTROLLER_STATE.name, CONTROLLER_STATE.publish
        )
        for topic, callback, raw in (
            (JOINT_TRAJECTORY, self.on_joint_trajectory, True),
            (CARTESIAN_GOAL, self.on_cartesian_goal, False),
            (CARTESIAN_PATH, self.on_cartesian_path, True),
            (JOINT_STATES, self.on_joint_states, True),
        ):
            self.create_subscription(
                topic.type, topic.name, surviving(self, callback), topic.subscribe, raw=raw
            )

    @property
    def follower(self) -> Follower | None:
        """What gives the reference; None until the arm has been seen."""
        return self._goals.follower

    @property
    def busy(self) -> bool:
        """Whether a goal is being planned or a law built; done within a tick once it is ready."""
        return self._goals.busy or self._builder.busy

    def destroy_node(self) -> None:
        """End the threads, and the node."""
        self._goals.close()
        self._builder.close()
        super().destroy_node()

    def _made(self, params: ControllerParams) -> AnyController:
        if params.task_frame:  # refused at once, not when a law first needs it
            TaskSpace(self._dynamics, params.task_frame, selection=task_axes(params))
        return make_controller(params.controller, self._dynamics, self._settings(params))

    def _settings(self, params: ControllerParams) -> Settings:
        return settings_of(params, self._dynamics.model.effort_limit)

    def _to_build(self, name: str, params: ControllerParams) -> Job | None:
        return preparation(name, self._dynamics, self._settings(params))

    def _apply(self, params: ControllerParams) -> None:
        before, control = self._params, self._made(params)
        gains = {"bandwidth": before.bandwidth, "damping_ratio": before.damping_ratio}
        retune = replace(params, **gains) == before and not self._builder.busy

        def put() -> None:
            if retune:
                self._control.retune(control)
                return
            self._control.to(control)
            self.get_logger().info(f"controller {params.controller}")
            if before.controller == _FREE != params.controller:
                self._goals.follower = None  # hold the arm where it was led to

        self._params = params
        self._log.forget()
        self._builder.give_up()
        if (job := self._to_build(params.controller, params)) is None:
            put()
        else:  # the law before goes on meanwhile
            self._builder.start(job, lambda built: self._put(built, put))

    def _build_ahead(self, params: ControllerParams) -> None:
        """Build what the first law needs at once, and what one in task space needs aside."""
        if job := self._to_build(params.controller, params):
            job()
        if job := self._to_build(IN_TASK_SPACE[0], params):
            self._builder.start(job, lambda built: None)  # what is wrong matters when it is used

    def _put(self, built: Callable[[], object], put: Callable[[], None]) -> None:
        try:
            built()
        except ArmError as error:
            self.get_logger().error(f"controller refused, the one before goes on: {error}")
        else:
            put()

    def on_joint_states(self, raw: bytes) -> bytes | None:
        """Answer a serialized JointState with a serialized command, at once.

        Returns:
            The command that was published, or None when the state could not be used.
        """
        self._builder.deliver()
        self._goals.deliver()
        if (command := self._log.again(raw)) is not None:
            self._send(command)
            return command
        try:
            stamp, (q, v) = self._reader.read(raw)
        except InvalidInput as error:
            self._log.passed_over += 1
            self._say(f"joint state passed over: {error}")
            return None
        state = Checked(np.array(q), np.array(v))
        reference = self._reference(stamp, state)
        tau = self._control.torque(state, reference)
        if not finite_numbers(tau.tolist()):
            self._control.restart()
            self._say(f"no command, the torque would not be finite: {tau}")
            return None
        if cut := self._cut():
            self._say(f"torque cut at the effort limit: {', '.join(cut)}")
        command = self._writer.write(stamp, self._dynamics.command_map(state.q, state.v, tau))
        self._send(command)
        self._log.note(raw, command)
        if stamp >= self._next_report:
            self._publish_report(stamp, reference, state, tau)
        return command

    def _reference(self, stamp: int, state: Measured) -> Reference:
        goals, jump = self._goals, self._jump(stamp)
        if goals.follower is None or jump:
            why = f"time went {jump}: " if jump else ""
            if jump:
                self._log.jumps += 1
                self._control.restart()
            self.get_logger().info(
                f"{why}holding where the arm is", throttle_duration_sec=_THROTTLE
            )
            goals.hold(state.q)
            self._next_report = 0
        return goals.reference(stamp)

    def _jump(self, stamp: int) -> str:
        """How time jumped since the last state, if it did; the arm is not where it was led to."""
        if self._goals.follower is None:
            return ""
        gap = 1e-9 * (stamp - self._goals.stamp)
        if gap < 0.0:
            return "backwards"
        limit = self._params.gap_limit
        return f"on by {gap:.3g} s between two states" if 0.0 < limit < gap else ""

    def _cut(self) -> list[str]:
        law = self._control.active
        if not (isinstance(law, Saturated) and law.saturated.any()):
            return []
        joints = zip(self._dynamics.joint_names, law.saturated, strict=True)
        return [name for name, is_cut in joints if is_cut]

    def _findings(self) -> list[Finding]:
        about = {"goal": self._goals.outcome, "goals refused": self._goals.refused}
        return [self._log.finding(self, self._params.controller, self._cut(), about)]

    def _say(self, warning: str) -> None:
        self.get_logger().warning(warning, throttle_duration_sec=_THROTTLE)

    def on_joint_trajectory(self, message: bytes | JointTrajectory) -> None:
        """Follow a trajectory from the present reference on, or say why not."""
        self._log.forget()
        self._goals.trajectory(as_bytes(message))

    def on_cartesian_goal(self, message: PoseStamped) -> None:
        """Lead the frame of the task straight to a pose, or say why not."""
        self._log.forget()
        self._goals.pose(message, self._params)

    def on_cartesian_path(self, message: bytes | Path) -> None:
        """Lead the frame of the task through poses, or say why not."""
        self._log.forget()
        self._goals.path(as_bytes(message), self._params)

    def _publish_report(
        self, stamp: int, reference: Reference, state: Measured, tau: Array
    ) -> None:
        """Publish ``~/state`` when somebody listens, at most once in ``state_period``."""
        self._next_report = stamp + round(1e9 * self._params.state_period)
        if self._report.get_subscription_count():
            names = self._dynamics.joint_names
            message = convert.tracking_state(stamp, names, reference, state, tau)
            message.goal = self._goals.outcome
            message.remaining = self._goals.follower.remaining(stamp)
            self._report.publish(message)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    take_short_turns()
    sys.exit(run(ControllerNode, args))
