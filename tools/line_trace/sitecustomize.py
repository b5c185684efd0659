# SPDX-License-Identifier: Apache-2.0
"""Which lines of ``src`` each test runs, also in the processes that it starts; for ``mutate.py``.

Python imports this file by itself at the start of every process that has its folder on the path.
It watches only where ``LINE_TRACE`` names a folder, and writes one file there for each process:
``{"lines": {test: {file: [lines]}}, "seconds": {test: duration}}``. Lines of functions count;
those that run when a module is imported belong to no test. For pytest: PYTEST_DONT_REWRITE.
"""

from __future__ import annotations

import atexit
import json
import os
import sys
from collections import defaultdict
from types import CodeType

FOLDER, SOURCE = os.environ.get("LINE_TRACE", ""), os.environ.get("LINE_TRACE_SOURCE", "")
FUNCTION = 0x02  # CO_NEWLOCALS: neither a module nor a class

lines: defaultdict[str, defaultdict[str, set[int]]] = defaultdict(lambda: defaultdict(set))
seconds: defaultdict[str, float] = defaultdict(float)
current = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]


def pytest_runtest_logstart(nodeid: str) -> None:
    """Lines count for this test from now on."""
    global current
    current = nodeid
    sys.monitoring.restart_events()


def pytest_runtest_logreport(report) -> None:
    """Add the time of a part of a test."""
    seconds[report.nodeid] += report.duration


def pytest_sessionfinish() -> None:
    """Write before the processes of a parallel run are ended."""
    if FOLDER:
        _write()


def _on_line(code: CodeType, line: int) -> object:
    if code.co_flags & FUNCTION and code.co_filename.startswith(SOURCE):
        lines[current][code.co_filename[len(SOURCE) :]].add(line)
    return sys.monitoring.DISABLE


def _write() -> None:
    found = {t: {f: sorted(n) for f, n in files.items()} for t, files in lines.items() if t}
    with open(os.path.join(FOLDER, f"{os.getpid()}.json"), "w", encoding="utf-8") as file:
        json.dump({"lines": found, "seconds": seconds}, file)


if FOLDER:
    monitoring = sys.monitoring
    monitoring.use_tool_id(monitoring.COVERAGE_ID, "line_trace")
    monitoring.register_callback(monitoring.COVERAGE_ID, monitoring.events.LINE, _on_line)
    monitoring.set_events(monitoring.COVERAGE_ID, monitoring.events.LINE)
    atexit.register(_write)
