# SPDX-License-Identifier: Apache-2.0
"""What a controller has answered: the last answer again, and how it is doing."""

from __future__ import annotations

import time

from rclpy.node import Node

from arm_dynamics.ros.common.diagnostics import ERROR, WARN, Finding, Growth

SILENCE = 1.0  # [s] without a joint state after which it is reported


class AnswerLog:
    """Remembers the last state and its answer, and counts.

    A state that comes again, byte for byte, gets the same answer: a partner in lockstep asks again
    when a message was lost, and a controller with memory must not take that for another tick.

    Attributes:
        passed_over: States that could not be used.
        jumps: How often time or the arm jumped from one state to the next.
        failure: Why the controller gives no torque; empty while it does.
    """

    def __init__(self) -> None:
        self._raw, self._command = b"", b""
        self._seen = self._since = time.monotonic()
        self._answers = self.passed_over = self.jumps = 0
        self.failure = ""
        self._growth = Growth()

    def again(self, raw: bytes) -> bytes | None:
        """The answer that this state got if it is the last one, else None."""
        self._seen = time.monotonic()
        return self._command if raw == self._raw else None

    def note(self, raw: bytes, command: bytes) -> None:
        """Take note of an answer."""
        self._raw, self._command = raw, command
        self._answers += 1
        self.failure = ""

    def forget(self) -> None:
        """Answer the next state anew even if it is the last one."""
        self._raw = b""

    def finding(
        self, node: Node, controller: str, cut: list[str], goals: dict[str, str | int]
    ) -> Finding:
        """How it is doing, for ``/diagnostics``.

        Args:
            node: The controller.
            controller: Name of the active one.
            cut: Joints whose torque was cut at its limit.
            goals: What became of the newest goal, and how many ``goals refused``.
        """
        now, found = time.monotonic(), Finding("controller")
        executor = type(node.executor).__name__ if node.executor is not None else "none"
        found.values = {
            "controller": controller, "rate [Hz]": self._answers / max(now - self._since, 1e-9),
            "last state [s]": now - self._seen, "states passed over": self.passed_over,
            "jumps of time": self.jumps, **goals, "executor": executor,
        }  # fmt: skip
        if self.failure:
            found.complain(ERROR, self.failure)
        if now - self._seen > SILENCE:
            found.complain(ERROR, f"no joint state for {now - self._seen:.1f} s")
        self._growth.warn(found, self.passed_over, "joint states passed over")
        self._growth.warn(found, int(goals["goals refused"]), "goals refused")
        if self._growth.of("jumps", self.jumps):
            found.complain(WARN, "time jumped, or the arm; held where it was")
        if cut:
            found.complain(WARN, f"torque cut at the effort limit: {', '.join(cut)}")
        self._answers, self._since = 0, now
        return found
