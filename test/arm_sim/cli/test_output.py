# SPDX-License-Identifier: Apache-2.0
"""Numbers, tables and progress displays."""

import io
import logging
import threading
import time
from contextlib import redirect_stderr, redirect_stdout

import pytest
from rich.console import Console
from rich.table import Table

from arm_sim.cli import output
from arm_sim.figures import units


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


def test_a_pipe_gets_lines_of_what_surely_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "PATIENCE", 0.01)
    pipe, doing = io.StringIO(), ["drawing picture 1"]

    def heard(words: str) -> None:
        end = time.monotonic() + 20.0
        while words not in pipe.getvalue():
            assert time.monotonic() < end, pipe.getvalue()
            time.sleep(0.001)

    with redirect_stderr(pipe), output.waiting(lambda: doing[-1], in_lines=True):
        heard("picture 1")
        doing.append("drawing picture 2")
        with output.waiting("building an arm", in_lines=True):
            heard("building")
        heard("picture 2")
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


@pytest.mark.parametrize(
    ("value", "digits", "said"),
    [(1234567.0, 6, "1.23457e+06"), (0.1234567, 3, "0.123"), (-0.0, 6, "0"), (-2.0, 6, "-2"),
     (-1e-9, 2, "-1e-09")],
)  # fmt: skip
def test_numbers_have_so_many_digits(value: float, digits: int, said: str) -> None:
    assert output.number(value, digits) == output.limit(value, digits) == said


def test_what_is_unlimited_is_a_dash_and_units_are_those_of_the_joints() -> None:
    assert output.limit(float("inf")) == output.limit(-float("inf")) == "-"
    assert output.number(0.12345678) == output.limit(0.12345678) == "0.123457"
    assert units(["revolute", "continuous"], "rad", "m") == "rad"
    assert units(["prismatic"], "rad", "m") == "m"
    assert units(["prismatic", "revolute"], "rad", "m") == "rad, m"
    assert units(["revolute", "prismatic"], "rad", "m", " or ") == "rad or m"


def printed(made: Table, width: int) -> list[str]:
    """The lines of a table on a terminal that is so wide."""
    screen = io.StringIO()
    with redirect_stdout(screen):
        output.show(Console(width=width), made)
    return [line.rstrip() for line in screen.getvalue().splitlines() if line.strip()]


def test_tables_align_words_left_and_numbers_right_and_are_never_cut() -> None:
    rows = [("[a]", "1", "no"), ("longer :name:", "1234567", "none at all")]
    made = output.table(("joint", "torque", "friction"), rows, text=(0, 2))
    head, _, first, second = printed(made, 80)
    assert head == " joint           torque  friction"
    assert first == " [a]                  1  no"
    assert second == " longer :name:  1234567  none at all"
    assert [line for line in printed(made, 10) if "1234567" in line] == [second]
