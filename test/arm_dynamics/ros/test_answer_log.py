# SPDX-License-Identifier: Apache-2.0
"""A state that is repeated byte for byte gets the same answer."""

from __future__ import annotations

import pytest

from arm_dynamics.ros.controller import AnswerLog

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
    assert log.again(b"state") is log.again(b"") is None


def test_states_of_any_size_are_remembered() -> None:
    log = AnswerLog()
    for size in (10, 5000, 100_000, 20):
        log.note(b"x" * size, b"%d" % size)
        assert log.again(b"x" * size) == b"%d" % size
