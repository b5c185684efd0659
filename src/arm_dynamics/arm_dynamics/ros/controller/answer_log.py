# SPDX-License-Identifier: Apache-2.0
"""The controller's last answer, to be repeated, and the counters of its diagnostics."""

import time
from ctypes import addressof, byref

from arm_dynamics.codegen.addresses import address
from arm_dynamics.ros.common.diagnostics import ERROR, WARN, Finding, Growth
from arm_dynamics.ros.controller.controller_library import HEADER, library

_ROOM = 4096  # bytes of a state at first
SILENCE = 1.0  # [s] without a joint state after which it is reported


class AnswerLog:
    """Remembers the last state and its answer, and counts failures.

    A state that is repeated byte for byte gets the same answer: in lockstep, the simulator repeats
    a state when a message was lost, and a controller with memory must not count it as a new tick.

    Attributes:
        ignored_count: Number of states that could not be used.
        failure: Why the controller computes no torque; empty while it does.
        address: Address of ``last_message_t``, in which C remembers the states that it answers.
    """

    def __init__(self) -> None:
        self._last, self._command = HEADER.structure("last_message_t")(), b""
        self.address = addressof(self._last)
        self._make_room(_ROOM)
        self._last_arrival = self._since = time.monotonic()  # [s]
        self._answer_count = self.ignored_count = self._jump_count = 0
        self.failure = self._complaint = ""
        self._growth = Growth()

    def receive(self, raw: bytes) -> bytes | None:
        """Register a state that has arrived; return its answer if it repeats the last one."""
        self._last_arrival = time.monotonic()
        is_repeated = library().is_repeated(byref(self._last), raw, len(raw))
        return self._command if is_repeated else None

    def ignore(self, complaint: str) -> None:
        """Count a state that cannot be used, because of a complaint."""
        self.ignored_count += 1
        self._complaint = complaint

    def fail(self, failure: str) -> None:
        """Register that the controller computes no torque, until its next answer."""
        self.failure = failure

    def count_jump(self) -> None:
        """Count a jump of time or of the arm between two states."""
        self._jump_count += 1

    def note(self, raw: bytes, command: bytes) -> None:
        """Store an answer."""
        if len(raw) > self._last.room:
            self._make_room(2 * len(raw))
        library().remember_state(byref(self._last), raw, len(raw))
        self._command = command
        self._answer_count += 1
        self.failure = ""

    def _make_room(self, size: int) -> None:
        self._memory = bytearray(size)
        self._last.raw, self._last.room = address(self._memory), size

    def add_compiled(self, count: int, last_time: float, command: bytes) -> None:
        """Log answers of C: how many, the last one's monotonic time in [s], and its command."""
        self._answer_count += count
        self._last_arrival, self._command = last_time, command

    def forget(self) -> None:
        """Compute the answer to the next state even if it repeats the last one."""
        self._last.length = 0

    def finding(
        self, controller: str, saturated: list[str], refused: int, goals: dict[str, str | int],
        answers: dict[str, str | int | float],
    ) -> Finding:  # fmt: skip
        """Condition of the controller, for ``/diagnostics``.

        Args:
            controller: Name of the active controller.
            saturated: Names of the joints whose torque is clipped at the effort limit.
            refused: Number of goals that were refused.
            goals: Values on goals, by their names.
            answers: Values on answers, by their names.
        """
        now, finding = time.monotonic(), Finding("controller")
        silence, elapsed = now - self._last_arrival, max(now - self._since, 1e-9)
        finding.values = {
            "controller": controller, "rate [Hz]": self._answer_count / elapsed,
            "last state [s]": silence, "states passed over": self.ignored_count,
            "jumps of time": self._jump_count, **goals, **answers,
        }  # fmt: skip
        finding.add(ERROR, self.failure)
        if silence > SILENCE:
            finding.add(ERROR, f"no joint state for {silence:.1f} s")
        self._growth.warn(
            finding, self.ignored_count, "joint state", f"ignored: {self._complaint}"
        )
        self._growth.warn(finding, refused, "goal", "refused")
        if self._growth.update("jumps", self._jump_count):
            finding.add(WARN, "time or the arm jumped; the arm was held at its position")
        if saturated:
            finding.add(WARN, f"torque clipped at the effort limit: {', '.join(saturated)}")
        self._answer_count, self._since = 0, now
        return finding
