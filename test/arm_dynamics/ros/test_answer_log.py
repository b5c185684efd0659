# SPDX-License-Identifier: Apache-2.0
"""A state that is repeated byte for byte gets the same answer."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from arm_dynamics.ros.common.diagnostics import ERROR, OK
from arm_dynamics.ros.controller import AnswerLog, answer_log

pytestmark = pytest.mark.ros


def test_only_the_last_state_is_answered_again() -> None:
    log = AnswerLog()
    for state in (b"first", b"second"):
        log.note(state, b"answer to " + state)
    assert log.again(b"second") == b"answer to second"
    assert log.again(b"first") is log.again(b"secon") is log.again(b"Second") is None


def test_without_an_answer_nothing_is_repeated() -> None:
    log = AnswerLog()
    assert log.again(b"") is None
    log.note(b"state", b"answer")
    log.forget()
    assert log.again(b"state") is log.again(b"s") is log.again(b"") is None


def test_states_of_any_size_are_remembered() -> None:
    log = AnswerLog()
    for size in (10, 5000, 100_000, 20):
        log.note(b"x" * size, b"%d" % size)
        assert log.again(b"x" * size) == b"%d" % size


def test_rates_and_silence_are_those_since_the_last_report(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By a clock that is set; C answers some of the states."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(answer_log, "time", SimpleNamespace(monotonic=lambda: clock.now))
    log = AnswerLog()

    def report(since: float) -> tuple[bytes, float, float]:
        clock.now += since
        goals = {"goal": "", "goals refused": 0}
        found = log.finding(SimpleNamespace(executor=None), "pd", [], goals, {"answered in C": 7})
        assert found.values["executor"] == "none" and found.values["answered in C"] == 7
        return found._level, found.values["rate [Hz]"], found.values["last state [s]"]

    assert report(0.5) == (OK, 0.0, 0.5)
    for state in (b"one", b"two"):
        assert log.again(state) is None
        log.note(state, b"answer")
    log.add(3, clock.now + 0.25, b"the last of three")
    assert report(0.5) == (OK, 10.0, 0.25)
    assert log.again(b"two") == b"the last of three"
    assert report(1.0) == (OK, 0.0, 1.0)
    assert report(0.125) == (ERROR, 0.0, 1.125)
