# SPDX-License-Identifier: Apache-2.0
"""When a request is repeated, by a simulated clock, and how long the client waits in all."""

from collections.abc import Callable, Collection, Iterator
from typing import Any

import pytest
from harness import Ros
from rclpy.node import Node

from arm_dynamics.exceptions import InvalidInput, NoAnswer
from arm_dynamics.ros.common import caller as module
from arm_dynamics.ros.common.caller import Caller
from arm_dynamics.ros.interfaces import MODEL_INFO

pytestmark = pytest.mark.ros

TIMEOUT = 12.0  # [s]


class World:
    """Time that passes while somebody waits, and a service of which a test says what it does.

    Attributes:
        now: The time in [s].
        asked: When requests were sent.
        answered: From the number of a request, when its answer comes.
        servers: How many there are, by time.
    """

    def __init__(self) -> None:
        self.now, self.asked = 100.0, list[float]()
        self.answered: Callable[[int], float] = lambda number: float("inf")
        self.servers: Callable[[float], int] = lambda now: 1

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds


class Client:
    """A client of that service; it has waited before it looks for an answer, as the real one."""

    def __init__(self, world: World, name: str) -> None:
        self.name, self._world = name, world
        self.has_answered, self.server_count = False, None

    def is_ready(self) -> bool:
        return True

    def send(self, request: Any) -> int:
        self._world.asked.append(self._world.now)
        return len(self._world.asked) - 1

    def receive(self, asked: Collection[int], timeout: float) -> Any | None:
        comes, number = min((self._world.answered(k), k) for k in asked)
        self._world.now = max(self._world.now, min(comes, self._world.now + timeout))
        return number if comes <= self._world.now else None


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    made = World()
    monkeypatch.setattr(module, "time", made)
    monkeypatch.setattr(module, "PolledClient", lambda node, service, name: Client(made, name))
    monkeypatch.setattr(Node, "count_services", lambda node, name: made.servers(made.now))
    return made


@pytest.fixture
def caller(ros: Ros, world: World) -> Iterator[Caller]:
    made = Caller(TIMEOUT, ros.domain)
    yield made
    made.close()


def ask(caller: Caller, world: World, repeatable: bool = True) -> tuple[Any, list[float], float]:
    """What is answered, None if nothing; when was asked; and when the end came, from now on."""
    begin = world.now
    world.asked.clear()
    try:
        response = caller.ask("node", MODEL_INFO, None, repeatable)
    except NoAnswer:
        response = None
    times = [round(time - begin, 6) for time in world.asked]
    return response, times, round(world.now - begin, 6)


def meet(caller: Caller, world: World) -> None:
    """Let the service answer at once, once."""
    world.answered = lambda number: world.now
    assert ask(caller, world) == (0, [0.0], 0.0)
    world.answered = lambda number: float("inf")


def test_whom_one_meets_is_asked_again_ever_later(caller: Caller, world: World) -> None:
    assert ask(caller, world) == (None, [0.0, 0.4, 1.2, 2.8, 6.0, 10.0], TIMEOUT)


def test_what_must_not_be_repeated_is_asked_once_and_strangers_are_given_time_to_see_us(
    caller: Caller, world: World
) -> None:
    assert ask(caller, world, repeatable=False) == (None, [0.3], 0.3 + TIMEOUT)
    meet(caller, world)
    assert ask(caller, world, repeatable=False) == (None, [0.0], TIMEOUT)


def test_the_first_answer_counts_whichever_request_it_is_for(caller: Caller, world: World) -> None:
    answers, begin = {0: 0.62, 1: 0.61}, world.now
    world.answered = lambda k: begin + answers.get(k, float("inf"))
    assert ask(caller, world) == (1, [0.0, 0.4], 0.61)


def test_when_the_number_of_servers_changes_it_is_asked_again_at_once(
    caller: Caller, world: World
) -> None:
    """The one that was asked may be the one that is gone; the new one is a stranger."""
    meet(caller, world)
    begin = world.now
    world.servers = lambda now: 1 if now < begin + 1.01 else 0
    response, times, end = ask(caller, world)
    assert response is None
    assert times[:4] == pytest.approx([0.0, 1.05, 1.45, 2.25], abs=1e-6)
    assert end == TIMEOUT


def test_a_name_that_no_node_can_have_is_refused(caller: Caller) -> None:
    for name in ("", "left/1st", "{sim}"):
        with pytest.raises(InvalidInput, match=f"node '{name}'; expected a name such as 'sim'"):
            caller.ask(name, MODEL_INFO, None)
