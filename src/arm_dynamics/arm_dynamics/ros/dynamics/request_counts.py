# SPDX-License-Identifier: Apache-2.0
"""Counts of requests that a node has answered and refused, and their durations."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.node import Node

from arm_dynamics.ros.common.diagnostics import WARN, Finding, Growth

Answer = Callable[[Any, Any], Any]


class InC(NamedTuple):
    """Counts of requests that C answered.

    Attributes:
        answered: Requests that it answered.
        lost: Responses that could not be sent, including those of Python, since the client is
            gone.
        busy: Time spent on the answers in [s].
    """

    answered: int
    lost: int
    busy: float


class RequestCounts:
    """Counts the calls of service callbacks.

    Attributes:
        descriptions_refused: Robot descriptions that could not be used.
    """

    def __init__(self) -> None:
        self.descriptions_refused = 0
        self._asked = self._refused = 0
        self._busy = self._before = 0.0  # [s] in Python, and in C until the last finding
        self._since = time.monotonic()
        self._growth = Growth()

    def counted(self, answer: Answer) -> Answer:
        """The callback ``answer``, counted."""

        def counting(request: Any, response: Any) -> Any:
            began = time.monotonic()
            response = answer(request, response)
            self._asked += 1
            self._refused += not response.success
            self._busy += time.monotonic() - began
            return response

        return counting

    def finding(self, node: Node, in_c: InC | None) -> Finding:
        """The counts, for ``/diagnostics``.

        Args:
            node: The node.
            in_c: Further requests; None where there is no compiled code for them.
        """
        now, found = time.monotonic(), Finding("services")
        executor = type(node.executor).__name__ if node.executor is not None else "none"
        further = in_c or InC(0, 0, 0.0)
        busy, self._before = self._busy + further.busy - self._before, further.busy
        found.values = {
            "requests": self._asked + further.answered, "refused": self._refused,
            "answered in C": further.answered if in_c else "none, there is no compiled code",
            "busy": busy / max(now - self._since, 1e-9),
            "responses lost": further.lost,
            "descriptions refused": self.descriptions_refused, "executor": executor,
        }  # fmt: skip
        self._growth.warn(found, self._refused, "requests refused")
        self._growth.warn(found, further.lost, "responses lost, the client is gone")
        if self._growth.of("descriptions", self.descriptions_refused):
            found.add(WARN, "a robot description was refused")
        self._busy, self._since = 0.0, now
        return found
