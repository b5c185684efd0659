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
        passed_over: Number of states that could not be used.
        unusable: Why, of the last of them.
        jumps: Number of jumps of time or of the arm between two states.
        failure: Why the controller computes no torque; empty while it does.
        address: Address of ``last_t``, in which C remembers the states that it answers.
    """

    def __init__(self) -> None:
        self._last, self._command = HEADER.structure("last_t")(), b""
        self.address = addressof(self._last)
        self._make_room(_ROOM)
        self._heard = self._since = time.monotonic()  # [s]
        self._answers = self.passed_over = self.jumps = 0
        self.failure = self.unusable = ""
        self._growth = Growth()

    def again(self, raw: bytes) -> bytes | None:
        """The answer to this state if it is the last one, else None."""
        self._heard = time.monotonic()
        repeated = library().is_repeated(byref(self._last), raw, len(raw))
        return self._command if repeated else None

    def note(self, raw: bytes, command: bytes) -> None:
        """Store an answer."""
        if len(raw) > self._last.room:
            self._make_room(2 * len(raw))
        library().remember_state(byref(self._last), raw, len(raw))
        self._command = command
        self._answers += 1
        self.failure = ""

    def _make_room(self, size: int) -> None:
        self._memory = bytearray(size)
        self._last.raw, self._last.room = address(self._memory), size

    def add(self, count: int, at: float, command: bytes) -> None:
        """Log answers of C: their number, the monotonic time of the last one in [s], and it."""
        self._answers += count
        self._heard, self._command = at, command

    def forget(self) -> None:
        """Compute the answer to the next state even if it repeats the last one."""
        self._last.length = 0

    def finding(
        self, controller: str, cut: list[str], refused: int, goals: dict[str, str | int],
        answers: dict[str, str | int | float],
    ) -> Finding:  # fmt: skip
        """Condition of the controller, for ``/diagnostics``.

        Args:
            controller: Name of the active controller.
            cut: Names of the joints whose torque is clipped at the effort limit.
            refused: Number of goals that were refused.
            goals: Values on goals, by their names.
            answers: Values on answers, by their names.
        """
        now, finding = time.monotonic(), Finding("controller")
        finding.values = {
            "controller": controller, "rate [Hz]": self._answers / max(now - self._since, 1e-9),
            "last state [s]": now - self._heard, "states passed over": self.passed_over,
            "jumps of time": self.jumps, **goals, **answers,
        }  # fmt: skip
        finding.add(ERROR, self.failure)
        if now - self._heard > SILENCE:
            finding.add(ERROR, f"no joint state for {now - self._heard:.1f} s")
        self._growth.warn(finding, self.passed_over, "joint state", f"ignored: {self.unusable}")
        self._growth.warn(finding, refused, "goal", "refused")
        if self._growth.of("jumps", self.jumps):
            finding.add(WARN, "time or the arm jumped; the arm was held at its position")
        if cut:
            finding.add(WARN, f"torque clipped at the effort limit: {', '.join(cut)}")
        self._answers, self._since = 0, now
        return finding
