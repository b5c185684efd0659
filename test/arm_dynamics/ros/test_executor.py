# SPDX-License-Identifier: Apache-2.0
"""Every executor that can be chosen dispatches callbacks."""

import gc
import signal
import sys
from typing import Any

import pytest
import rclpy.experimental.events_executor as events_executor
from harness import Ros
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common import executor as module
from arm_dynamics.ros.common.endpoints import subscribe
from arm_dynamics.ros.common.executable import run
from arm_dynamics.ros.common.executor import make_executor, spin
from arm_dynamics.ros.interfaces import DIAGNOSTICS

pytestmark = pytest.mark.ros


class Deaf:
    """An executor that dispatches nothing, by a clock of its own."""

    def __init__(self, context: Any) -> None:
        self.closed = False
        self.waits = list[float]()

    def monotonic(self) -> float:
        return sum(self.waits)

    def add_node(self, node: Node) -> None:
        pass

    def remove_node(self, node: Node) -> None:
        pass

    def spin_once(self, timeout_sec: float) -> None:
        self.waits.append(timeout_sec)

    def shutdown(self) -> None:
        self.closed = True


@pytest.fixture
def node(ros: Ros) -> Any:
    """A node that is not being spun."""
    node = Node("spun", context=ros.context)
    yield node
    node.destroy_node()


def ticks_of(node: Node) -> int:
    called: list[int] = []
    node.create_timer(0.005, lambda: called.append(1))
    spin(node, lambda: len(called) >= 3)
    return len(called)


def test_dispatches(node: Node) -> None:
    assert ticks_of(node) >= 3


def test_falls_back_when_the_events_executor_dispatches_nothing(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    deaf = Deaf(None)
    monkeypatch.setattr(events_executor, "EventsExecutor", lambda context: deaf)
    with monkeypatch.context() as patched:
        patched.setattr(module, "time", deaf)
        executor = make_executor(node)
    assert isinstance(executor, SingleThreadedExecutor)
    assert deaf.closed
    assert sum(deaf.waits) == 0.5  # [s] that a start may lose
    executor.remove_node(node)
    executor.shutdown()
    assert ticks_of(node) >= 3


def test_an_idle_node_looks_four_times_a_second_whether_to_end(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    deaf = Deaf(None)
    monkeypatch.setattr(module, "make_executor", lambda node: deaf)
    spin(node, lambda: len(deaf.waits) == 3)
    assert deaf.waits == [0.25] * 3
    assert deaf.closed


def test_the_events_executor_is_taken_although_there_is_other_work(node: Node) -> None:
    node.create_timer(1e-5, lambda: None)
    executor = make_executor(node)
    assert not isinstance(executor, SingleThreadedExecutor)
    executor.remove_node(node)
    executor.shutdown()


def test_the_probe_leaves_nothing_behind(node: Node) -> None:
    executor = make_executor(node)
    assert list(node.timers) == []
    executor.shutdown()


def test_a_callback_that_fails_does_not_end_the_node(
    node: Node, capfd: pytest.CaptureFixture[str]
) -> None:
    subscribe(node, DIAGNOSTICS, lambda message: 1 / message).callback(0)
    assert "ZeroDivisionError" in capfd.readouterr().err


@pytest.mark.parametrize("built", [False, True])
@pytest.mark.parametrize(
    "error", [InvalidInput("no arm"), OSError("no disk"), RuntimeError("odd")]
)
def test_why_a_node_ended_is_one_line_unless_it_is_a_fault_of_the_program(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], error: Exception,
    built: bool,
) -> None:  # fmt: skip
    made, ended = list[Any](), list[str]()

    class Failing(Node):
        def destroy_node(self) -> None:
            ended.append(self.get_name())
            super().destroy_node()

    def make(**kwargs: Any) -> Node:
        made.append(kwargs["context"])
        if built:
            return Failing("failing", **kwargs)
        raise error

    def done() -> bool:
        raise error

    monkeypatch.setattr(signal, "signal", lambda *_: None)
    if isinstance(error, RuntimeError):
        with pytest.raises(RuntimeError, match="odd"):
            run(make, [], done)
    else:
        assert run(make, [], done) == 2
        assert f"error: {error}\n" in capfd.readouterr().err
    assert not made[0].ok()
    assert ended == ["failing"] * built


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"tolerence": 1e-8}, "which is ignored; did you mean 'tolerance'? allowed: "),
        ({"use_sim_time": True, "later.joint": 1.0}, ""),
    ],
)
def test_parameters_that_a_node_has_not_are_told(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], given: dict[str, Any],
    said: str,
) -> None:  # fmt: skip
    def make(**kwargs: Any) -> Node:
        made = Node(
            "tolerant", parameter_overrides=[Parameter(n, value=x) for n, x in given.items()],
            **kwargs,
        )  # fmt: skip
        made.declare_parameter("tolerance", 0.1)
        return made

    monkeypatch.setattr(signal, "signal", lambda *_: None)
    assert run(make, [], lambda: True) == 0
    told = capfd.readouterr().err
    assert said in told
    assert ("did you mean 'tolerance'?" in told) == bool(said)


def test_a_process_of_one_node_takes_short_turns_and_skips_garbage_of_its_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = list[float]()

    def make(**kwargs: Any) -> Node:
        found.append(sys.getswitchinterval())
        made = Node("urgent", **kwargs)
        made.declare_parameter("freeze_garbage", True)
        return made

    monkeypatch.setattr(signal, "signal", lambda *_: None)
    before, frozen = sys.getswitchinterval(), gc.get_freeze_count()
    sys.setswitchinterval(5e-3)  # whatever a node that ran here before has left
    assert run(make, [], lambda: True) == 0
    sys.setswitchinterval(before)
    assert found[0] < 1e-3
    assert gc.get_freeze_count() > frozen
    gc.unfreeze()
