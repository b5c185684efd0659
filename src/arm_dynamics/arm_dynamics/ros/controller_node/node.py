# SPDX-License-Identifier: Apache-2.0
"""The controller node: moves an arm along trajectories with a selectable controller."""

import os
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from arm_dynamics.actuation.command_map import rigid_twin
from arm_dynamics.arrays import Array, are_finite
from arm_dynamics.control.controller import CheckedState, Measured
from arm_dynamics.control.filters.derived_velocity import DerivedVelocity
from arm_dynamics.control.wrappers import Saturated
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ControllerFailed, InvalidInput, plain
from arm_dynamics.logs import PERIOD, Throttled
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.convert import as_bytes
from arm_dynamics.ros.common.diagnostics import ERROR, WARN, Diagnosis, Finding, Lateness
from arm_dynamics.ros.common.endpoints import subscribe
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.common.params import declare
from arm_dynamics.ros.common.robot_source import scene_for
from arm_dynamics.ros.controller.answer_log import AnswerLog
from arm_dynamics.ros.controller.compiled_answers import CompiledAnswers
from arm_dynamics.ros.controller.controller_library import prepare
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.ros.controller.jumps import Jumps
from arm_dynamics.ros.controller.selection import ControllerSelection
from arm_dynamics.ros.controller.shared_answers import Parts
from arm_dynamics.ros.controller.state_source import StateSource
from arm_dynamics.ros.controller.tracking import TrackingTopic
from arm_dynamics.ros.controller.trajectory_action import TrajectoryAction
from arm_dynamics.ros.joint_state import JointStateFormat, JointStateReader, JointStateSink, Read
from arm_dynamics.ros.joint_state.format import MissingNumbers
from arm_dynamics.ros.joint_state.serialization import JointStateWriter
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.reference import Reference


class ControllerNode(Node):
    """Answers every joint state with a joint command.

    It holds the arm at its first position, and at its position after time went backwards, until a
    trajectory, a pose or a path arrives. Time is that of the states' stamps. The controller may be
    changed in motion: a new one is prepared in the background, and the old one stays active until
    it is ready.

    Attributes:
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
        params = declare(self, ControllerParams)
        robot_scene, _ = scene_for(self, scene, params.scene, params)
        self.dynamics = Dynamics(rigid_twin(robot_scene))
        names, model = self.dynamics.joint_names, self.dynamics.model
        self.answers, self._log = CompiledAnswers(), AnswerLog()
        limits = Limits.of(model, params.acceleration_limit or float("inf"))
        self._jumps, self._source = Jumps(names), StateSource(self)
        self._throttled = Throttled(self.get_logger())
        self.goals = Goals(
            model, limits, Throttled(self.get_logger()), self.answers.interrupt, self._log.forget
        )
        text = "joint states came up to {:.2g} s apart"
        self._lateness = Lateness(self, self._jumps.take_longest, params.settings.dt, text)
        self._velocity = self._velocity_of(params)
        self._selection = ControllerSelection(
            self, params, self.dynamics, self.answers, self._log, self.goals,
            self._lateness, self._velocity,
        )  # fmt: skip
        self.control = self._selection.control
        self.action = TrajectoryAction(
            self, self.goals, model, limits, self._selection.obstacle, self.answers, self._lateness
        )
        fields = ("position",) if self._velocity else ("position", "velocity")
        self._reader = JointStateReader(JointStateFormat(names, fields, ignores_extra=True))
        source = f"{self.get_fully_qualified_name()}:{os.getpid()}"  # unique to this controller
        self._writer = JointStateWriter(names, ("effort",), frame_id=source)
        self._command = np.zeros(self.dynamics.n)
        self._sink = JointStateSink(self, interfaces.JOINT_COMMANDS, self._writer, [self._command])
        self.send = self._sink.publish
        self._report = TrackingTopic(self, names)
        subscribe(self, interfaces.JOINT_TRAJECTORY, self.on_joint_trajectory, raw=True)
        subscribe(self, interfaces.CARTESIAN_GOAL, self.on_cartesian_goal)
        subscribe(self, interfaces.CARTESIAN_PATH, self.on_cartesian_path, raw=True)
        self._selection.watch()
        self._diagnosis = Diagnosis(self, self.diagnostics)
        steady_timer(self, PERIOD, self.goals.log_unlogged)
        self._complete = True
        states = self.resolve_topic_name(interfaces.JOINT_STATES.name)
        self.get_logger().info(f"answers {states}; to move the arm: ./arm go {names[-1]}+=0.1")
        self._subscribe_states(own_thread)

    def _velocity_of(self, params: ControllerParams) -> DerivedVelocity | None:
        """What derives velocities from positions, if states have none."""
        if params.velocities != "positions":
            return None
        velocity = DerivedVelocity(self.dynamics.n, params.settings.dt, params.velocity_cutoff)
        delay = f"{1e3 * velocity.delay:.3g} ms"
        self.get_logger().info(f"velocities are derived from positions, {delay} late")
        return velocity

    def _subscribe_states(self, own_thread: bool) -> None:
        """Subscribe to states, with a thread of their own if that is requested and possible."""
        parts = Parts(
            self._reader, self._sink, self._command, self._report, self.control,
            self.dynamics.command_map, self.goals, self.action, self._jumps, self._log,
            self._source,
        )  # fmt: skip
        # What is granted to the states' thread, the middleware's threads do not have.
        direct = not (self.params.priority or self.params.cpus)
        if not (own_thread and self.answers.start(self, parts, self._answer, self._claim, direct)):
            subscribe(self, interfaces.JOINT_STATES, self.on_joint_states, raw=True)
            self._claim()

    def _claim(self) -> None:
        """Claim the privileges of the thread that answers states."""
        for refusal in self.params.claim():
            self.get_logger().warning(f"not granted: {refusal}")

    def _answer(self, raw: bytes) -> None:
        """Answer a state, and let C answer the following ones where possible."""
        if self.on_joint_states(raw) is None or self._saturated_joints():
            return
        derived = self._velocity is not None
        refusal = "velocities are derived from positions" if derived else ""
        self.answers.resume(self.params, refusal)
        if self._selection.builder.ready or self.goals.planner.ready:
            self.answers.interrupt()

    @property
    def params(self) -> ControllerParams:
        """The parameters in force."""
        return self._selection.params

    @property
    def busy(self) -> bool:
        """Whether a goal is being planned or a controller prepared in the background."""
        return self.goals.planner.busy or self._selection.builder.busy

    def deliver(self) -> None:
        """Apply the results of background work; called before every answer to a joint state."""
        with self.answers:
            self._selection.builder.deliver()
            self.goals.planner.deliver()

    def destroy_node(self) -> None:
        """End the threads, and the node."""
        if self._complete:
            self.answers.close()
            self.goals.planner.close()
            self._selection.builder.close()
            self.action.close()
        super().destroy_node()

    def on_joint_states(self, raw: bytes) -> bytes | None:
        """Answer a serialized JointState with a serialized command, at once.

        Returns:
            The command that was published, or None when the state could not be used.
        """
        with self.answers:
            self.deliver()
            return self._command_for(raw)

    def _command_for(self, raw: bytes) -> bytes | None:
        """The command that answers a state, after it was published; None if there is none."""
        if (command := self._log.receive(raw)) is not None:
            self.send(command)
            return command
        if (read := self._read(raw)) is None:
            return None
        stamp, _ = read
        state, reference = self._state_and_reference(read)
        if (tau := self._torque(state, reference)) is None:
            return None
        command = self._writer.write(stamp, self.dynamics.command_map(state.q, state.v, tau))
        self.send(command)
        self._log.note(raw, command)
        self.action.monitor(stamp, reference, state)
        self._report.publish(stamp, self.params.state_period, self.goals, reference, state, tau)
        return command

    def _read(self, raw: bytes) -> Read | None:
        """The stamp and the numbers of a state; None if it cannot be used."""
        try:
            read = self._reader.read(raw)
        except InvalidInput as error:
            lacks_velocities = isinstance(error, MissingNumbers) and error.field == "velocity"
            way_out = "; 'velocities: positions' derives them" if lacks_velocities else ""
            self._log.ignore(complaint := f"{plain(error)}{way_out}")
            self._throttled.warning(f"joint state ignored: {complaint}")
            return None
        return read if self._source.accept(self._reader.sender) else None

    def _state_and_reference(self, read: Read) -> tuple[Measured, Reference]:
        """The state from what was read, and the reference at its stamp, which a jump restarts."""
        stamp, (positions, *velocities) = read
        q = np.array(positions)
        if self._velocity is None:
            state = CheckedState(q, np.array(velocities[0]))
            return state, self._reference(stamp, state)
        reference = self._reference(stamp, CheckedState(q, self._velocity.last))
        return CheckedState(q, self._velocity(stamp, q)), reference

    def _torque(self, state: Measured, reference: Reference) -> Array | None:
        """The controller's torque, shape (n,); None, with a message, if it computes none."""
        try:
            tau = self.control.torque(state, reference)
        except ControllerFailed as error:
            # No command is sent, so that the arm's stale-command policy stops it.
            self._log.fail(
                f"{error}; no commands until it is tuned, another one is selected, or "
                "the simulation is reset"
            )
            self._throttled.error(self._log.failure)
            self.action.abort("Current goal cancelled, the controller failed.")
            return None
        if not are_finite(tau.tolist()):
            self.control.restart()
            self._log.fail(f"no command, the torque would not be finite: {tau}")
            self._throttled.warning(self._log.failure)
            return None
        if saturated := self._saturated_joints():
            self._throttled.warning(f"torque clipped at the effort limit: {', '.join(saturated)}")
        return tau

    def _reference(self, stamp: int, state: Measured) -> Reference:
        """The reference at a state's stamp; after a jump, and at first, the arm's position."""
        goals, params = self.goals, self.params
        jump = self._jumps.detect(stamp, state, params.gap_limit, params.jump_limit)
        if jump:
            self._log.count_jump()
            self.control.restart()
            if self._velocity is not None:
                self._velocity.restart()
        if goals.follower is None or jump:
            prefix = f"{jump}: " if jump else ""
            self._throttled.info(f"{prefix}holding the arm at its position")
            goals.hold(state.q, jump)
            self._report.restart()
        return goals.reference(stamp)

    def _saturated_joints(self) -> list[str]:
        """Names of the joints whose torques were clipped at their limits."""
        active = self.control.active
        if not (isinstance(active, Saturated) and active.saturated.any()):
            return []
        joints = zip(self.dynamics.joint_names, active.saturated, strict=True)
        return [name for name, is_saturated in joints if is_saturated]

    def diagnostics(self) -> list[Finding]:
        """Diagnostics since the last call."""
        with self.answers:
            goals = {"goal": self.goals.outcome, "goals refused": self.goals.refused}
            answers = self.answers.summary()
            answers["longest time between states [s]"] = self._lateness.longest
            name, saturated = self._selection.active_params.controller, self._saturated_joints()
            finding = self._log.finding(name, saturated, self.goals.refused, goals, answers)
            finding.add(WARN, self._lateness.message)
            finding.add(WARN, self._selection.gain_warning)
            finding.add(ERROR, self._source.alarm.message)
            return [finding]

    def on_joint_trajectory(self, message: bytes | JointTrajectory) -> None:
        """Follow a trajectory from the current reference, or report why not."""
        with self.answers:
            self.goals.trajectory(as_bytes(message))

    def on_cartesian_goal(self, message: PoseStamped) -> None:
        """Move the task frame along a straight line to a pose, or report why not."""
        with self.answers:
            self.goals.pose(message, self.params)

    def on_cartesian_path(self, message: bytes | Path) -> None:
        """Move the task frame through poses, or report why not."""
        with self.answers:
            self.goals.path(as_bytes(message), self.params)
