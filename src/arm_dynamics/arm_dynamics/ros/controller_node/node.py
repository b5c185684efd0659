# SPDX-License-Identifier: Apache-2.0
"""The controller node: moves an arm along trajectories with a selectable controller."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any, Concatenate

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from arm_dynamics.actuation.command_map import rigid_twin
from arm_dynamics.arrays import Array, finite_numbers
from arm_dynamics.control.compiled_law import Job, preparation
from arm_dynamics.control.controller import Checked, Measured
from arm_dynamics.control.derived_velocity import DerivedVelocity
from arm_dynamics.control.factory import (
    IN_TASK_SPACE,
    Settings,
    make_controller,
    overreach,
    refuse_unsteady,
)
from arm_dynamics.control.wrappers import AnyController, Saturated, Switch
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ArmError, ControllerFailed, InvalidInput, plain
from arm_dynamics.logs import Throttled
from arm_dynamics.ros.common.background import Background
from arm_dynamics.ros.common.convert import as_bytes
from arm_dynamics.ros.common.diagnostics import ERROR, WARN, Diagnosis, Finding, Lateness
from arm_dynamics.ros.common.executor import subscribe
from arm_dynamics.ros.common.params import declare, watch
from arm_dynamics.ros.common.robot_source import scene_for
from arm_dynamics.ros.controller import (
    AnswerLog,
    CompiledAnswers,
    ControllerParams,
    Followed,
    Goals,
    Jumps,
    Loaded,
    Parts,
    TrackingTopic,
    TrajectoryAction,
)
from arm_dynamics.ros.controller.controller_library import prepare
from arm_dynamics.ros.interfaces import (
    CARTESIAN_GOAL,
    CARTESIAN_PATH,
    JOINT_COMMANDS,
    JOINT_STATES,
    JOINT_TRAJECTORY,
)
from arm_dynamics.ros.joint_state import JointStateReader, JointStateSink, JointStateWriter
from arm_dynamics.task_space.task_space import TaskSpace
from arm_dynamics.trajectory.follower import Follower
from arm_dynamics.trajectory.reference import Limits, Reference

_GAINS = ("bandwidth", "damping_ratio", "stiffness", "damping")
_FREE = "float"  # the controller for hand guiding: the arm moves away from its reference


def _locked[**P, R](
    method: Callable[Concatenate[ControllerNode, P], R],
) -> Callable[Concatenate[ControllerNode, P], R]:
    """A method that holds the lock of the controller's parts; meanwhile C answers no states."""

    @wraps(method)
    def called(node: ControllerNode, *args: P.args, **named: P.kwargs) -> R:
        with node.answers:
            return method(node, *args, **named)

    return called


class ControllerNode(Node):
    """Answers every joint state with a joint command.

    It holds the arm at its first position, and at its position after time went backwards, until a
    trajectory, a pose or a path arrives. Time is that of the states' stamps. The controller may be
    changed in motion: a new one is prepared in the background, and the old one stays active until
    it is ready.

    Attributes:
        params: The parameters in force.
        dynamics: The model of the controllers.
        control: The active controller, and the transition to the next one.
        goals: The current goal, and goals being planned.
        action: Goals of ``~/follow_joint_trajectory``.
        answers: Answers ordinary states in C; holds the lock of the parts.
        send: Publishes a serialized command.
    """

    _complete = False  # a node that could not be built is destroyed, too, by Kilted's rclpy

    def __init__(self, scene: Any = None, *, own_thread: bool = False, **node_kwargs: Any) -> None:
        """Start the node.

        Args:
            scene: Anything ``load_scene`` accepts; if None, the parameter ``scene``, else a robot
                description, from the parameter or topic ``robot_description``.
            own_thread: Answer states on a thread of the node's own, in C where possible, until the
                node is destroyed; by default the executor that spins the node answers them.
            **node_kwargs: For ``rclpy.node.Node``: context, namespace, parameter_overrides, …

        Raises:
            ArmError: If there is no scene, or a scene or parameter that cannot be used.
        """
        super().__init__("controller", **node_kwargs)
        prepare()  # now, not while a state waits
        self.params = declare(self, ControllerParams)
        chosen, _ = scene_for(self, scene, self.params.scene, self.params)
        self.dynamics = Dynamics(rigid_twin(chosen))
        self._loaded = Loaded(self.params, self.dynamics.model, self._settings(self.params))
        names = self.dynamics.joint_names
        period, fade = self.params.settings.dt, self.params.switch_time
        self.control = Switch(self._made(self.params), period, fade)
        self._acting = self.params  # of the active controller
        self.answers = CompiledAnswers()
        self._builder = Background("builder", self.answers.interrupt)
        model = self.dynamics.model
        self._build_ahead(self.params)
        limits = Limits.of(model, self.params.acceleration_limit or float("inf"))
        self._log, self._jumps, self._followed = AnswerLog(), Jumps(names), Followed(self)
        self._throttled = Throttled(self.get_logger())
        interrupt, forget = self.answers.interrupt, self._log.forget
        self.goals = Goals(model, limits, Throttled(self.get_logger()), interrupt, forget)
        words = "joint states came up to {:.2g} s apart"
        self._late = Lateness(self, self._jumps.take_longest, period, words)
        self.action = TrajectoryAction(
            self, self.goals, model, limits, self._obstacle, self.answers, self._late
        )
        self._velocity = self._derived()
        self._tell_overreach(self.params)
        fields = ("position",) if self._velocity else ("position", "velocity")
        self._reader = JointStateReader(names, fields, partial=False, extra=True)
        me = f"{self.get_fully_qualified_name()}:{os.getpid()}"  # unique to this controller
        self._writer = JointStateWriter(names, ("effort",), frame_id=me)
        self._connect()
        watch(self, self.params, self._apply)
        self._diagnosis = Diagnosis(self, self.diagnostics)
        self._complete = True
        self._hear(own_thread)

    def _connect(self) -> None:
        self._command = np.zeros(self.dynamics.n)
        self._sink = JointStateSink(self, JOINT_COMMANDS, self._writer, [self._command])
        self.send = self._sink.publish
        self._report = TrackingTopic(self, self.dynamics.joint_names)
        for topic, callback, raw in (
            (JOINT_TRAJECTORY, self.on_joint_trajectory, True),
            (CARTESIAN_GOAL, self.on_cartesian_goal, False),
            (CARTESIAN_PATH, self.on_cartesian_path, True),
        ):
            subscribe(self, topic, callback, raw)

    def _hear(self, own_thread: bool) -> None:
        """Subscribe to states, with a thread of their own if it is wanted and possible."""
        parts = Parts(
            self._reader, self._sink, self._command, self._report, self.control,
            self.dynamics.command_map, self.goals, self.action, self._jumps, self._log,
            self._followed,
        )  # fmt: skip
        # What is granted to the states' thread, the middleware's threads do not have.
        direct = not (self.params.priority or self.params.cpus)
        if not (own_thread and self.answers.start(self, parts, self._answer, self._claim, direct)):
            subscribe(self, JOINT_STATES, self.on_joint_states, raw=True)
            self._claim()

    def _claim(self) -> None:
        """Claim the privileges of the thread that answers states."""
        for refusal in self.params.claim():
            self.get_logger().warning(f"not granted: {refusal}")

    def _answer(self, raw: bytes) -> None:
        """Answer a state, and let C answer the following ones where possible."""
        if self.on_joint_states(raw) is None or self._cut():
            return
        if self._velocity is not None:
            self.answers.obstacle = "velocities are derived from positions"
            return
        self.answers.resume(self.params)
        if self._builder.ready or self.goals.planner.ready:
            self.answers.interrupt()

    @property
    def follower(self) -> Follower | None:
        """Computes the reference; None until the first joint state."""
        return self.goals.follower

    @property
    def busy(self) -> bool:
        """Whether a goal is being planned or a controller prepared in the background."""
        return self.goals.planner.busy or self._builder.busy

    @_locked
    def deliver(self) -> None:
        """Apply the results of background work; called before every answer to a joint state."""
        self._builder.deliver()
        self.goals.planner.deliver()

    def destroy_node(self) -> None:
        """End the threads, and the node."""
        if self._complete:
            self.answers.close()
            self.goals.planner.close()
            self._builder.close()
            self.action.close()
        super().destroy_node()

    def _obstacle(self) -> str:
        """Reason why trajectories are not followed now; empty if they are."""
        free = _FREE in (self.params.controller, self._acting.controller)
        return self._log.failure or ("controller 'float' follows no trajectories" if free else "")

    def _made(self, params: ControllerParams) -> AnyController:
        frame, axes = params.settings.frame, params.settings.axes
        if frame:  # rejected here, not when a controller first uses it
            TaskSpace(self.dynamics, frame, selection=axes)
        settings, chosen = self._settings(params), self._loaded.maker(params.controller)
        control = make_controller(chosen, self.dynamics, settings)
        refuse_unsteady(settings)
        return control

    def _tell_overreach(self, params: ControllerParams) -> None:
        """Warn of gains that the loop, as late as it is now, does not carry."""
        settings, chosen = self._settings(params), self._loaded.maker(params.controller)
        delay = self.dynamics.model.scene.delay + max(settings.dt, self._late.longest)
        delay += 0.0 if self._velocity is None else self._velocity.delay
        self._overreach = overreach(chosen, self.dynamics, settings, delay)
        if self._overreach:
            self.get_logger().warning(self._overreach)

    def _settings(self, params: ControllerParams) -> Settings:
        return replace(params.settings, limit=self.dynamics.model.effort_limit)

    def _preparation(self, control: AnyController) -> Job | None:
        return preparation(control.control if isinstance(control, Saturated) else control)

    @_locked
    def _apply(self, params: ControllerParams) -> None:
        before, control = self._acting, self._made(params)
        gains = {name: getattr(before.settings, name) for name in _GAINS}
        same = replace(params, settings=replace(params.settings, **gains)) == before

        def put() -> None:
            self._acting = params
            if self._log.failure:  # the arm has been braked: there is no torque to fade from
                self.control.restart()
                self.goals.drop("as the controller had failed")
            if same:
                self.control.retune(control)
                return
            self.control.to(control)
            self.get_logger().info(f"controller {params.controller}")
            if before.controller == _FREE != params.controller:
                self.goals.drop("as the arm was led by hand")

        self.params = params
        self._log.forget()
        self._builder.give_up()
        if (job := self._preparation(control)) is None:
            put()
        else:
            self._builder.start(job, lambda built: self._put(built, put))
        self._tell_overreach(params)

    def _build_ahead(self, params: ControllerParams) -> None:
        """Prepare the first controller now, and a task-space controller in the background."""
        if job := self._preparation(self.control.active):
            job()
        if not params.settings.frame:
            return
        another = make_controller(IN_TASK_SPACE[0], self.dynamics, self._settings(params))
        if job := self._preparation(another):
            self._builder.start(job, lambda built: None)  # errors matter when it is selected

    def _put(self, built: Callable[[], object], put: Callable[[], None]) -> None:
        try:
            built()
        except ArmError as error:
            kept = "controller refused, the old one stays active"
            self.get_logger().error(f"{kept}: {plain(error)}")
        else:
            put()

    @_locked
    def on_joint_states(self, raw: bytes) -> bytes | None:
        """Answer a serialized JointState with a serialized command, at once.

        Returns:
            The command that was published, or None when the state could not be used.
        """
        self.deliver()
        if (command := self._log.again(raw)) is not None:
            self.send(command)
            return command
        try:
            stamp, (q, *v) = self._reader.read(raw)
        except InvalidInput as error:
            lacking = str(error).startswith("velocity")
            way_out = "; 'velocities: positions' derives them" if lacking else ""
            self._log.pass_over(f"{plain(error)}{way_out}")
            self._throttled.warning(f"joint state ignored: {self._log.unusable}")
            return None
        if not self._followed.includes(self._reader.sender):
            return None
        state, reference = self._motion(stamp, np.array(q), *map(np.array, v))
        try:
            tau = self.control.torque(state, reference)
        except ControllerFailed as error:
            # No command is sent, so that the arm's stale-command policy stops it.
            self._log.failure = (
                f"{error}; no commands until it is tuned, another one is selected, or "
                "the simulation is reset"
            )
            self._throttled.error(self._log.failure)
            self.action.abort("Current goal cancelled, the controller failed.")
            return None
        if not finite_numbers(tau.tolist()):
            self.control.restart()
            self._throttled.warning(f"no command, the torque would not be finite: {tau}")
            return None
        if cut := self._cut():
            self._throttled.warning(f"torque clipped at the effort limit: {', '.join(cut)}")
        command = self._writer.write(stamp, self.dynamics.command_map(state.q, state.v, tau))
        self.send(command)
        self._log.note(raw, command)
        self.action.watch(stamp, reference, state)
        self._report.publish(stamp, self.params.state_period, self.goals, reference, state, tau)
        return command

    def _reference(self, stamp: int, state: Measured) -> Reference:
        goals, params = self.goals, self.params
        jump = self._jumps.look(stamp, state, params.gap_limit, params.jump_limit)
        if goals.follower is None or jump:
            why = f"{jump}: " if jump else ""
            if jump:
                self._log.jumps += 1
                self.control.restart()
                if self._velocity is not None:
                    self._velocity.restart()
            self._throttled.info(f"{why}holding the arm at its position")
            goals.hold(state.q, jump)
            self._report.restart()
        return goals.reference(stamp)

    def _derived(self) -> DerivedVelocity | None:
        """What derives velocities from positions; None if the states have them."""
        if self.params.velocities == "states":
            return None
        cutoff, period = self.params.velocity_cutoff, self.params.settings.dt
        derived = DerivedVelocity(self.dynamics.n, period, cutoff)
        self.get_logger().info(
            f"velocities are derived from positions, {1e3 * derived.delay:.3g} ms late"
        )
        return derived

    def _motion(self, stamp: int, q: Array, v: Array | None = None) -> tuple[Checked, Reference]:
        """The state, with velocities if those must be derived, and the reference."""
        derived = self._velocity
        if derived is None:
            state = Checked(q, v)
            return state, self._reference(stamp, state)
        reference = self._reference(stamp, Checked(q, derived.last))
        return Checked(q, derived(stamp, q)), reference

    def _cut(self) -> list[str]:
        active = self.control.active
        if not (isinstance(active, Saturated) and active.saturated.any()):
            return []
        joints = zip(self.dynamics.joint_names, active.saturated, strict=True)
        return [name for name, is_cut in joints if is_cut]

    @_locked
    def diagnostics(self) -> list[Finding]:
        """Diagnostics since the last call."""
        about = {"goal": self.goals.outcome, "goals refused": self.goals.refused}
        answers = self.answers.summary()
        answers["longest time between states [s]"] = self._late.longest
        found = self._log.finding(self, self._acting.controller, self._cut(), about, answers)
        for words in (self._late.words, self._overreach):
            found.complain(WARN, words)
        found.complain(ERROR, self._followed.alarm.words)
        return [found]

    @_locked
    def on_joint_trajectory(self, message: bytes | JointTrajectory) -> None:
        """Follow a trajectory from the current reference, or report why not."""
        self.goals.trajectory(as_bytes(message))

    @_locked
    def on_cartesian_goal(self, message: PoseStamped) -> None:
        """Move the task frame along a straight line to a pose, or report why not."""
        self.goals.pose(message, self.params)

    @_locked
    def on_cartesian_path(self, message: bytes | Path) -> None:
        """Move the task frame through poses, or report why not."""
        self.goals.path(as_bytes(message), self.params)
