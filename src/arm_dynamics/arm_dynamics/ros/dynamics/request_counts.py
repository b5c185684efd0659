# SPDX-License-Identifier: Apache-2.0
"""Counts of requests that a node has answered and refused, and their durations."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from arm_dynamics.ros.common.diagnostics import WARN, Finding, Growth


class RequestCounts:
    """Counts requests to services.

    Attributes:
        descriptions_refused: Robot descriptions that could not be used.
    """

    def __init__(self) -> None:
        self.descriptions_refused = 0
        self._requests = self._refused = 0
        self._busy_in_python = 0.0  # [s] since the last finding
        self._busy_in_c = 0.0  # [s] until the last finding, in all
        self._since = time.monotonic()
        self._growth = Growth()

    @contextmanager
    def counting(self, response: Any) -> Iterator[None]:
        """Count a request, whose response is filled meanwhile."""
        began = time.monotonic()
        yield
        self._requests += 1
        self._refused += not response.success
        self._busy_in_python += time.monotonic() - began

    def finding(self, in_c: Any | None) -> Finding:
        """Report the counts for ``/diagnostics``, and begin the next interval of ``busy``.

        ``in_c`` is the ``counts_t`` of services.h; None where C answers nothing.
        """
        now, finding = time.monotonic(), Finding("services")
        answered, lost, busy_in_c = 0, 0, 0.0
        if in_c is not None:
            answered, lost, busy_in_c = in_c.answered, in_c.lost, 1e-9 * in_c.busy
        busy = self._busy_in_python + busy_in_c - self._busy_in_c
        finding.values = {
            "requests": self._requests + answered, "refused": self._refused,
            "answered in C": answered if in_c is not None else "none, there is no compiled code",
            "busy": busy / max(now - self._since, 1e-9),
            "responses lost": lost,
            "descriptions refused": self.descriptions_refused,
        }  # fmt: skip
        self._growth.warn(finding, self._refused, "request", "refused")
        self._growth.warn(finding, lost, "response", "lost, the client is gone")
        if self._growth.update("descriptions", self.descriptions_refused):
            finding.add(WARN, "a robot description was refused")
        self._busy_in_python, self._busy_in_c, self._since = 0.0, busy_in_c, now
        return finding
