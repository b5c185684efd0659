# SPDX-License-Identifier: Apache-2.0
"""What Python and C share to answer states: ``answers_t`` of answers.h."""

from ctypes import Structure, addressof
from dataclasses import dataclass

import numpy as np

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.control.compiled_law import CompiledLaw, compiled_law
from arm_dynamics.control.controller import AnyController
from arm_dynamics.control.switch import Switch
from arm_dynamics.ros.controller.answer_log import AnswerLog
from arm_dynamics.ros.controller.controller_library import HEADER
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.ros.controller.jumps import Jumps
from arm_dynamics.ros.controller.state_source import StateSource
from arm_dynamics.ros.controller.tracking import TrackingTopic
from arm_dynamics.ros.controller.trajectory_action import TrajectoryAction
from arm_dynamics.ros.joint_state import JointStateReader, JointStateSink
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import Trajectory

_NEVER = 2**63 - 1


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


class SharedAnswers:
    """The memory from which C answers states, and in which it leaves results.

    Use it only while C does not answer, with the lock of ``CompiledAnswers``.

    Attributes:
        structure: The ``answers_t``, whose fields answers.h explains.
    """

    def __init__(self, parts: Parts) -> None:
        """Let C use the memory of the parts; their reader is open."""
        self._parts, self._tau = parts, np.zeros(parts.command.size)
        source, reader = parts.reader.addresses
        self.structure = HEADER.structure("answers_t")(
            source=source, reader=reader, sink=parts.sink.address, joints=parts.command.size,
            report=parts.report.address, command=parts.command.ctypes.data,
            previous=parts.jumps.address, tau=self._tau.ctypes.data,
            last_message=parts.log.address, publishers=addressof(parts.source.shared),
        )  # fmt: skip
        self._control: AnyController | None = None
        self._law: CompiledLaw | None = None  # of that controller
        self._references: tuple[object, ...] = ()  # kept alive while C uses their memory

    def activate(self, params: ControllerParams) -> str:
        """Let C answer the next states; return why it cannot, empty if it can."""
        answers, parts, follower = self.structure, self._parts, self._parts.goals.follower
        start, motion = follower.active
        factors = parts.command_map.factors
        if obstacle := self._find_obstacle(motion, factors):
            return obstacle
        answers.interrupt = 0
        arrays = _arrays(self._law, factors, motion)
        for field, array in arrays.items():
            setattr(answers, field, None if array is None else array.ctypes.data)
        answers.law = addressof(self._law.call.entry)
        answers.memory_size = arrays["memory"].size
        answers.start, answers.segments = start, len(motion.times) - 1
        answers.gap_limit, answers.jump_limit = params.gap_limit, params.jump_limit
        answers.until = _NEVER if follower.next_begin is None else follower.next_begin
        self._references = self._law, arrays, self._limit_errors()
        parts.report.prepare(params.state_period, parts.goals)
        answers.active = 1
        return ""

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

    def _limit_errors(self) -> Structure | None:
        """Let C check path tolerances of the active goal, and leave other checks to Python."""
        answers, goal = self.structure, self._parts.action.active
        answers.path = None
        if goal is None:
            return None
        first_check = max(goal.begin, goal.next_check)  # from then on every state
        answers.until, answers.path_begin = min(answers.until, first_check), goal.begin
        if goal.tolerances.path.is_none:
            return None
        allowed = goal.tolerances.arrays_of(goal.tolerances.path)
        answers.path = addressof(allowed)
        return allowed

    def deactivate(self) -> int:
        """Stop C from answering and update the parts with its results; return how many."""
        answers, parts = self.structure, self._parts
        count, answers.count = answers.count, 0
        answers.active = 0
        if count:
            parts.goals.stamp = parts.jumps.stamp
            parts.control.note(self._tau.copy())
            parts.log.add_compiled(count, 1e-9 * answers.last_time, bytes(parts.sink.raw))
        return int(count)

    def take_durations(self) -> tuple[int, int]:
        """Total and longest time of answers in [ns] since the last call."""
        durations = self.structure.total_time, self.structure.longest_time
        self.structure.total_time = self.structure.longest_time = 0
        return durations


def _arrays(law: CompiledLaw, factors: tuple[Array, ...], motion: Trajectory) -> dict[str, Array]:
    """Arrays that C uses, by the fields that point to them; None where there is none."""
    (inputs, _, memory), (torque, next_memory) = law.call.inputs, law.call.outputs
    gain, back_emf = factors or (None, None)
    return {
        "input": inputs, "memory": memory, "torque": torque, "next_memory": next_memory,
        "limit": law.limit, "gain": gain, "back_emf": back_emf,
        "knots": motion.times, "polynomials": motion.polynomials, "ends": motion.ends,
        "torques": motion.torques,
    }  # fmt: skip
