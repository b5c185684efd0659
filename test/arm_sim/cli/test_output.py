# SPDX-License-Identifier: Apache-2.0
"""Progress displays."""

from __future__ import annotations

import io
import logging
import threading
from contextlib import redirect_stderr

import pytest

from arm_sim.cli import output


class Screen(io.StringIO):
    """A terminal that signals when something is written to it."""

    def __init__(self) -> None:
        super().__init__()
        self.seen = threading.Event()

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        if "building" in text:
            self.seen.set()
        return super().write(text)


def test_what_takes_long_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "PATIENCE", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    screen = Screen()
    with redirect_stderr(screen), output.waiting("building an arm"):
        assert screen.seen.wait(timeout=20.0)
    assert not any(isinstance(thread, threading.Timer) for thread in threading.enumerate())


def test_what_is_quick_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "PATIENCE", 60.0)
    screen = Screen()
    with redirect_stderr(screen), output.waiting("building an arm"):
        pass
    assert screen.getvalue().strip() == ""
    assert not any(isinstance(thread, threading.Timer) for thread in threading.enumerate())


def test_a_pipe_gets_no_bar(capfd: pytest.CaptureFixture[str]) -> None:
    with output.waiting("building an arm"):
        pass
    assert capfd.readouterr().err == ""


def test_one_hears_at_a_time() -> None:
    log, heard = logging.getLogger("arm_dynamics.part"), list[str]()
    inner = logging.Handler()
    inner.emit = lambda record: heard.append(record.getMessage())  # type: ignore[method-assign]
    screen = Screen()
    with redirect_stderr(screen), output.progress_on_stderr():
        log.info("building one")
        with output.heard_by(inner):
            log.info("building another")
        log.info("building a third")
    log.info("unheard")
    assert heard == ["building another"]
    assert screen.getvalue().splitlines() == ["building one", "building a third"]
