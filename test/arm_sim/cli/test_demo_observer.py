# SPDX-License-Identifier: Apache-2.0
"""How long the demo waits, and its messages about nodes that do not start."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from harness import Ros

from arm_sim.cli.demo.observer import Observer
from arm_sim.cli.demo.processes import DemoFailed

pytestmark = pytest.mark.ros


class Waiting:
    """Notes for how long is waited; the first few wishes come true."""

    def __init__(self, granted: int) -> None:
        self.granted, self.timeouts = granted, list[float]()

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        condition()
        self.timeouts.append(timeout)
        return len(self.timeouts) <= self.granted


@pytest.fixture
def observer(ros: Ros) -> Iterator[Observer]:
    with Observer(["joint"], ros.domain, lambda: None) as made:
        yield made


@pytest.mark.parametrize(
    ("wait", "granted", "said"),
    [
        ("wait_for_partners", 0, "the dynamics node did not answer within 60 s"),
        ("wait_for_partners", 1, "the controller did not start within 60 s"),
        ("wait_for_motion", 0, "the controller sent no command within 60 s"),
        ("wait_for_motion", 1, "the sim node did not answer within 60 s"),
    ],
)
def test_at_the_start_each_is_waited_for_a_minute(
    observer: Observer, monkeypatch: pytest.MonkeyPatch, wait: str, granted: int, said: str
) -> None:
    waiting = Waiting(granted)
    monkeypatch.setattr(observer, "until", waiting.until)
    with pytest.raises(DemoFailed, match=said):
        getattr(observer, wait)()
    assert waiting.timeouts == [60.0] * (granted + 1)


def test_a_motion_is_waited_for_ten_seconds(
    observer: Observer, monkeypatch: pytest.MonkeyPatch
) -> None:
    state: Any = SimpleNamespace(reference_position=[0.0])
    observer._on_state(state)
    waiting = Waiting(0)
    monkeypatch.setattr(observer, "until", waiting.until)
    assert not observer.send([])
    assert waiting.timeouts == [10.0]
    assert observer.now() == 0.0
