# SPDX-License-Identifier: Apache-2.0
"""Numbers, tables and progress displays."""

import io
import logging
import time
from contextlib import redirect_stderr, redirect_stdout

import pytest
from rich.console import Console

from arm_sim.cli import output
from arm_sim.figures import units


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True


def heard(stream: io.StringIO, words: str) -> None:
    """Wait until it has been told."""
    end = time.monotonic() + 20.0
    while words not in stream.getvalue():
        assert time.monotonic() < end, stream.getvalue()
        time.sleep(0.001)


def test_what_takes_long_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """In place on a terminal; to a pipe in lines, only of what surely takes long."""
    monkeypatch.setattr(output, "PATIENCE", 0.01)
    screen, pipe, doing = Screen(), io.StringIO(), ["drawing picture 1"]
    with redirect_stderr(screen), output.waiting("building an arm"):
        heard(screen, "building an arm … 0 s")
    assert screen.getvalue().startswith("\r\033[K") and screen.getvalue().endswith("\r\033[K")
    with redirect_stderr(pipe), output.waiting("building an arm"):
        time.sleep(0.02)
    assert not pipe.getvalue()
    with redirect_stderr(pipe), output.waiting(lambda: doing[-1], in_lines=True):
        heard(pipe, "picture 1")
        doing.append("drawing picture 2")
        with output.waiting("building an arm", in_lines=True):
            heard(pipe, "building")
        heard(pipe, "picture 2")
    assert set(pipe.getvalue().splitlines()) == {
        "drawing picture 1 … 0 s", "building an arm … 0 s", "drawing picture 2 … 0 s",
    }  # fmt: skip


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


def test_what_is_unlimited_is_a_dash_and_units_are_those_of_the_joints() -> None:
    assert output.limit(float("inf")) == output.limit(-float("inf")) == "-"
    assert output.number(0.12345678) == output.limit(0.12345678) == "0.123457"
    assert units(["revolute", "continuous"], "rad", "m") == "rad"
    assert units(["prismatic"], "rad", "m") == "m"
    assert units(["prismatic", "revolute"], "rad", "m") == "rad, m"
    assert units(["revolute", "prismatic"], "rad", "m", " or ") == "rad or m"


def test_tables_align_words_left_and_numbers_right_and_are_never_cut() -> None:
    rows, screen = [("[a]", "1"), ("longer :name:", "1234567")], Screen()
    with redirect_stdout(screen):
        output.show(Console(width=10), output.table(("joint", "torque"), rows))
    for line in " [a]                  1", " longer :name:  1234567":
        assert line in screen.getvalue()
