# SPDX-License-Identifier: Apache-2.0
"""Answers ordinary joint states in C, without the interpreter lock.

A thread waits for states in C. Most are ordinary: time, arm and reference have advanced by one
step. C answers those with bitwise the same result as Python. All other states are passed to Python
unchanged, which alone decides on them. Jumps, references, tolerances, repeated states and the
tracking state are matters of C for both.

Python changes the parts of the controller under a lock that C holds while it answers a state. C
stops answering at every change, and resumes after the next answer by Python.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import addressof, byref, c_void_p
from dataclasses import dataclass
from functools import partial
from threading import Thread

import numpy as np
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.control.compiled_law import CompiledLaw, compiled_law
from arm_dynamics.control.controller import AnyController
from arm_dynamics.control.switch import Switch
from arm_dynamics.ros.common.endpoints import guarded
from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.controller.answer_log import AnswerLog
from arm_dynamics.ros.controller.controller_library import HEADER, library
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.ros.controller.jumps import Jumps
from arm_dynamics.ros.controller.state_source import StateSource
from arm_dynamics.ros.controller.tracking import TrackingTopic
from arm_dynamics.ros.controller.trajectory_action import TrajectoryAction
from arm_dynamics.ros.interfaces import JOINT_STATES
from arm_dynamics.ros.joint_state import FAILED, JointStateReader, JointStateSink
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import Trajectory

_ENDED = HEADER.constants["ENDED"]
_NEVER = 2**63 - 1
# Fast DDS's listeners may take and write; others hold locks meanwhile that taking needs.
_TAKE_IN_CALLBACKS = ("rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp")

# ``answers_t`` of answers.h, where the fields are explained
Answers = HEADER.structure("answers_t")


@dataclass(frozen=True)
class Parts:
    """Parts of the controller node that an answer depends on or changes.

    ``sink`` publishes from the array ``command``, of shape (n,).
    """

    reader: JointStateReader
    sink: JointStateSink
    command: Array
    report: TrackingTopic
    control: Switch
    command_map: CommandMap
    goals: Goals
    action: TrajectoryAction
    jumps: Jumps
    log: AnswerLog
    source: StateSource


class CompiledAnswers:
    """Answers ordinary states in C and passes all others to Python.

    As a context manager it is the lock of the controller's parts; it may be nested.

    Example:
        >>> answers = CompiledAnswers()
        >>> answers.start(node, parts, answer, claim)
        >>> with answers:
        ...     follow(goal)

    Attributes:
        obstacle: Why C answers no states at present; empty if it does.
        count: Number of states that C has answered.
    """

    def __init__(self) -> None:
        self.obstacle, self.count = "the executor answers", 0
        self._answers, self._receiver = Answers(), c_void_p(None)
        self._summarized = 0  # states, at the last summary
        self._control: AnyController | None = None
        self._law: CompiledLaw | None = None
        self._used: tuple[object, ...] = ()  # kept alive while C uses their memory

    def start(
        self, node: Node, parts: Parts, answer: Callable[[bytes], None], claim: Callable[[], None],
        direct: bool,
    ) -> bool:  # fmt: skip
        """Subscribe to the states and start the thread that answers them.

        Args:
            node: The controller.
            parts: Its parts.
            answer: Answers a state in Python; called with the lock held.
            claim: Called by the thread before the first state.
            direct: Whether C may answer on the thread of the middleware that brings a state, where
                the middleware allows it: that saves a change of threads.

        Returns:
            Whether it was started; if not, ``obstacle`` says why.
        """
        reader = parts.reader
        self._native, self._reader, self._parts = library(), reader, parts
        self._newest = PolledSubscription(node, JOINT_STATES)
        self._receiver = c_void_p(self._native.receiver(self._newest.pointer))
        if not self._receiver:
            self.obstacle = "the middleware does not report new messages"
            self._newest.close()
            return False
        reader.open(self._newest.pointer)
        self._tau = np.zeros(parts.command.size)
        source, state = reader.places
        self._answers = Answers(
            source=source, reader=state, sink=parts.sink.place, joints=parts.command.size,
            report=parts.report.place, command=parts.command.ctypes.data,
            before=parts.jumps.place, tau=self._tau.ctypes.data, last=parts.log.place,
            followed=addressof(parts.source.shared),
        )  # fmt: skip
        self._answer, self._claim = answer, claim
        self._direct = direct and get_rmw_implementation_identifier() in _TAKE_IN_CALLBACKS
        self._pass_on = guarded(node, self._in_python)
        node.context.on_shutdown(self._end)
        self._thread = Thread(target=self._serve, name="states", daemon=True)
        self._thread.start()
        return True

    def close(self) -> None:
        """End the thread and the subscription; call before the node is destroyed."""
        if not self._receiver:
            return
        self._end()
        self._thread.join()
        self._native.destroy(self._receiver)
        self._receiver = c_void_p(None)
        self._reader.close()
        self._newest.close()

    def __enter__(self) -> None:
        """Lock the parts of the controller and stop C from answering."""
        if self._receiver:
            self._native.lock(self._receiver)
            self._stop()

    def __exit__(self, *_: object) -> None:
        """Unlock them."""
        if self._receiver:
            self._native.unlock(self._receiver)

    def interrupt(self) -> None:
        """Have the next state answered in Python; may be called from any thread."""
        self._answers.interrupt = 1

    def summary(self) -> dict[str, str | int | float]:
        """Values for the diagnostics; times since the last call. The lock must be held."""
        answers, since = self._answers, max(1, self.count - self._summarized)
        values: dict[str, str | int | float] = {
            "answered in C": self.count,
            "answered in Python": self.obstacle or "few states, as after a change",
            "answer in C [µs]": 1e-3 * answers.busy / since,
            "longest answer in C [µs]": 1e-3 * answers.longest,
        }
        self._summarized = self.count
        answers.busy = answers.longest = 0
        return values

    def resume(self, params: ControllerParams) -> None:
        """Let C answer the next states, if possible. Call it locked, after an answer by Python."""
        answers, parts, follower = self._answers, self._parts, self._parts.goals.follower
        start, motion = follower.active
        factors, goal = parts.command_map.factors, parts.action.active
        self.obstacle = self._find_obstacle(motion, factors)
        if self.obstacle:
            return
        answers.interrupt = 0
        law, (gain, back_emf) = self._law, factors or (None, None)
        (inputs, _, memory), (torque, next_memory) = law.call.inputs, law.call.outputs
        arrays = {
            "input": inputs, "memory": memory, "torque": torque, "next_memory": next_memory,
            "limit": law.limit, "gain": gain, "back_emf": back_emf,
            "knots": motion.times, "polynomials": motion.polynomials, "ends": motion.ends,
            "torques": motion.torques,
        }  # fmt: skip
        for field, array in arrays.items():
            setattr(answers, field, None if array is None else array.ctypes.data)
        answers.law, answers.remembered = addressof(law.call.entry), memory.size
        answers.segments, answers.start = len(motion.times) - 1, start
        answers.until = _NEVER if follower.next_begin is None else follower.next_begin
        answers.gap, answers.far = params.gap_limit, params.jump_limit
        allowed = answers.path = None
        if goal is not None:
            checked = max(goal.begin, goal.next_check)  # from then on every state
            answers.until, answers.begin = min(answers.until, checked), goal.begin
            if not goal.tolerances.path.is_none:
                allowed = goal.tolerances.allowed(goal.tolerances.path)
                answers.path = addressof(allowed)
        self._used = law, arrays, allowed
        parts.report.prepare(params.state_period, parts.goals)
        answers.active = 1

    def _find_obstacle(self, motion: Motion, factors: object) -> str:
        """Reason why C cannot answer the next state; empty if it can."""
        control = self._parts.control
        if control.active is not self._control:
            self._control, self._law = control.active, compiled_law(control.active)
        if self._law is None:
            return "the controller is not compiled"
        if control.fading:
            return "controllers are being switched"
        if factors is None:
            return "commands depend on positions"
        return "" if isinstance(motion, Trajectory) else "the motion is a Cartesian path"

    def _stop(self) -> None:
        """Stop C from answering and update the parts with its results."""
        answers, parts = self._answers, self._parts
        count, answers.count = answers.count, 0
        answers.active = 0
        if not count:
            return
        self.count += count
        parts.goals.stamp = parts.jumps.stamp
        parts.control.note(self._tau.copy())
        parts.log.add(count, 1e-9 * answers.last_time, bytes(parts.sink.raw))

    def _end(self) -> None:
        if self._receiver:
            self._native.end(self._receiver)

    def _serve(self) -> None:
        """Answer states until the end."""
        self._claim()
        self._native.lock(self._receiver)
        serve = partial(self._native.serve, self._receiver, byref(self._answers), self._direct)
        while (outcome := serve()) != _ENDED:
            self._stop()
            self._pass_on(outcome)
        self._native.unlock(self._receiver)

    def _in_python(self, outcome: int) -> None:
        """Answer the state that C has taken with this outcome."""
        if outcome != FAILED:
            self._answer(self._reader.raw)
        elif message := self._newest.take():  # or it raises an error with the reason
            self._answer(message[0])
