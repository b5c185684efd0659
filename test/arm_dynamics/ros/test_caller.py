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
        offered: From when on there is a server.
    """

    def __init__(self) -> None:
        self.now, self.asked, self.offered = 100.0, list[float](), 0.0
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

    def ready(self) -> bool:
        return self._world.now >= self._world.offered

    def send(self, request: Any) -> int:
        assert len(self._world.asked) < 50
        self._world.asked.append(self._world.now)
        return len(self._world.asked) - 1

    def receive(self, asked: Collection[int], timeout: float) -> Any | None:
        assert timeout > 0.0
        assert self._world.now < 1e3  # no test lasts for so long
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


@pytest.mark.parametrize(
    ("answers", "number", "asked", "end"),
    [
        ({0: 0.39}, 0, 1, 0.39),
        ({0: 0.41}, 0, 2, 0.41),  # late, but an answer
        ({0: 0.62, 1: 0.61}, 1, 2, 0.61),
        ({5: 11.9}, 5, 6, 11.9),
    ],
)
def test_the_first_answer_counts_whichever_request_it_is_for(
    caller: Caller, world: World, answers: dict[int, float], number: int, asked: int, end: float
) -> None:
    begin = world.now
    world.answered = lambda k: begin + answers.get(k, float("inf"))
    response, times, last = ask(caller, world)
    assert (response, len(times), last) == (number, asked, end)


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


def test_a_server_is_waited_for(caller: Caller, world: World) -> None:
    world.offered = world.now + 11.5
    world.answered = lambda number: world.now
    response, times, _ = ask(caller, world)
    assert response == 0
    assert times == [pytest.approx(11.5, abs=0.011)]


def test_where_no_server_comes_it_is_said_what_there_is(
    ros: Ros, caller: Caller, world: World
) -> None:
    """The service under another name, the nodes, and the domain."""
    world.offered = float("inf")
    kind = MODEL_INFO.type
    for name in ("/left/model_info", "/left/other"):
        ros.peer.create_service(kind, name, lambda request, response: response)
    ros.adopt(Node("far", namespace="away", context=ros.context))
    services = lambda: dict(caller._node.get_service_names_and_types())  # noqa: E731
    ros.spin_until(lambda: {"/left/model_info", "/left/other"} <= services().keys())
    ros.spin_until(lambda: {"far", "test_peer"} <= set(caller._node.get_node_names()))
    begin = world.now
    with pytest.raises(NoAnswer) as caught:
        caller.ask("node", MODEL_INFO, None)
    assert not world.asked and world.now - begin == pytest.approx(TIMEOUT, abs=0.011)
    assert str(caught.value).split("\n  ") == [
        "no node offers /node/model_info (waited 12 s)",
        "it is offered as /left/model_info",
        "nodes seen: /away/far, /test_peer",
        f"both sides must have the same ROS_DOMAIN_ID; here it is {ros.domain}",
    ]


@pytest.mark.parametrize("name", ["", "bad name", "a//b", "left/1st", "{sim}"])
def test_a_name_that_no_node_can_have_is_refused(caller: Caller, name: str) -> None:
    with pytest.raises(InvalidInput, match=f"node '{name}'; expected a name such as 'sim'"):
        caller.ask(name, MODEL_INFO, None)
