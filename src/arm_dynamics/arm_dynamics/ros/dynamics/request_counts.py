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
        self._busy = self._before = 0.0  # [s] in Python, and in C until the last finding
        self._since = time.monotonic()
        self._growth = Growth()

    @contextmanager
    def counting(self, response: Any) -> Iterator[None]:
        """Count a request, whose response is filled meanwhile."""
        began = time.monotonic()
        yield
        self._requests += 1
        self._refused += not response.success
        self._busy += time.monotonic() - began

    def finding(self, in_c: Any | None) -> Finding:
        """The counts, for ``/diagnostics``, with ``counts_t`` of services.h if C answers, too."""
        now, finding = time.monotonic(), Finding("services")
        answered, lost, by_c = 0, 0, 0.0
        if in_c is not None:
            answered, lost, by_c = in_c.answered, in_c.lost, 1e-9 * in_c.busy
        busy, self._before = self._busy + by_c - self._before, by_c
        finding.values = {
            "requests": self._requests + answered, "refused": self._refused,
            "answered in C": answered if in_c else "none, there is no compiled code",
            "busy": busy / max(now - self._since, 1e-9),
            "responses lost": lost,
            "descriptions refused": self.descriptions_refused,
        }  # fmt: skip
        self._growth.warn(finding, self._refused, "request", "refused")
        self._growth.warn(finding, lost, "response", "lost, the client is gone")
        if self._growth.of("descriptions", self.descriptions_refused):
            finding.add(WARN, "a robot description was refused")
        self._busy, self._since = 0.0, now
        return finding
