# SPDX-License-Identifier: Apache-2.0
"""How many requests a node has answered and refused, and how long that took."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from arm_dynamics.ros.common.diagnostics import WARN, Finding, Growth

Answer = Callable[[Any, Any], Any]


class RequestCounts:
    """Counts what service callbacks do.

    Attributes:
        descriptions_refused: Robot descriptions that could not be used.
    """

    def __init__(self) -> None:
        self.descriptions_refused = 0
        self._asked = self._refused = 0
        self._busy = 0.0
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

    def finding(self, node: Node) -> Finding:
        """What was counted, for ``/diagnostics``."""
        now, found = time.monotonic(), Finding("services")
        executor = type(node.executor).__name__ if node.executor is not None else "none"
        found.values = {
            "requests": self._asked, "refused": self._refused,
            "busy": self._busy / max(now - self._since, 1e-9),
            "descriptions refused": self.descriptions_refused, "executor": executor,
        }  # fmt: skip
        self._growth.warn(found, self._refused, "requests refused")
        if self._growth.of("descriptions", self.descriptions_refused):
            found.complain(WARN, "a robot description was refused")
        self._busy, self._since = 0.0, now
        return found
