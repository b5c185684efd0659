# SPDX-License-Identifier: Apache-2.0
"""Nodes as programs: executors that dispatch, what ends a node, and its command line."""

import gc
import signal
import sys
from typing import Any
from unittest.mock import Mock

import pytest
import rclpy.experimental.events_executor as events_executor
from harness import Ros
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics import InvalidInput
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.common import executor as module
from arm_dynamics.ros.common.command_line import split_words
from arm_dynamics.ros.common.endpoints import subscribe
from arm_dynamics.ros.common.executable import execute, run
from arm_dynamics.ros.common.executor import make_executor
from arm_dynamics.ros.dynamics_node import DynamicsParams
from arm_dynamics.ros.interfaces import DIAGNOSTICS

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def no_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signal, "signal", lambda *_: None)


@pytest.fixture
def node(ros: Ros) -> Any:
    """A node that is not being spun."""
    node = Node("spun", context=ros.context)
    yield node
    node.destroy_node()


def test_the_events_executor_is_taken_although_there_is_other_work(node: Node) -> None:
    """What has tried it leaves nothing behind."""
    timer = node.create_timer(1e-5, lambda: None)
    executor = make_executor(node)
    assert not isinstance(executor, SingleThreadedExecutor)
    assert list(node.timers) == [timer]
    executor.remove_node(node)
    executor.shutdown()


def test_falls_back_when_the_events_executor_dispatches_nothing(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    deaf = Mock()
    monkeypatch.setattr(events_executor, "EventsExecutor", lambda context: deaf)
    monkeypatch.setattr(module, "_PROBE_TIMEOUT", 0.01)
    executor = make_executor(node)
    assert isinstance(executor, SingleThreadedExecutor)
    deaf.shutdown.assert_called_once()
    executor.shutdown()


def test_a_callback_that_fails_does_not_end_the_node(
    node: Node, capfd: pytest.CaptureFixture[str]
) -> None:
    subscribe(node, DIAGNOSTICS, lambda message: 1 / message).callback(0)
    assert "ZeroDivisionError" in capfd.readouterr().err


def test_a_fault_of_the_program_is_shown_and_ends_the_node() -> None:
    made, ended = list[Any](), list[str]()

    class Failing(Node):
        def destroy_node(self) -> None:
            ended.append(self.get_name())
            super().destroy_node()

    def make(**kwargs: Any) -> Node:
        made.append(kwargs["context"])
        return Failing("failing", **kwargs)

    def done() -> bool:
        raise RuntimeError("odd")

    with pytest.raises(RuntimeError, match="odd"):
        run(make, [], done)
    assert not made[0].ok() and ended == ["failing"]


def test_a_signal_just_after_the_start_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    handlers = list[Any]()

    def replace(number: int, handler: Any) -> None:
        handlers.append(handler)
        if len(handlers) == 3:  # after those of both signals, while the node was built
            handlers[0](number, None)

    monkeypatch.setattr(signal, "signal", replace)
    assert run(lambda **kwargs: Node("interrupted", **kwargs)) == 0


def test_parameters_that_a_node_has_not_are_told(capfd: pytest.CaptureFixture[str]) -> None:
    given = {"tolerence": 1e-8, "use_sim_time": True, "later.joint": 1.0}

    def make(**kwargs: Any) -> Node:
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        made = Node("tolerant", parameter_overrides=overrides, **kwargs)
        made.declare_parameter("tolerance", 0.1)
        return made

    assert run(make, [], lambda: True) == 0
    told = capfd.readouterr().err
    assert "which is ignored; did you mean 'tolerance'? allowed: " in told
    assert told.count("which is ignored") == 1


def test_a_process_of_one_node_takes_short_turns_and_skips_garbage_of_its_start() -> None:
    found = list[float]()

    def make(**kwargs: Any) -> Node:
        found.append(sys.getswitchinterval())
        made = Node("urgent", **kwargs)
        made.declare_parameter("freeze_garbage", True)
        return made

    before, frozen = sys.getswitchinterval(), gc.get_freeze_count()
    sys.setswitchinterval(5e-3)  # whatever a node that ran here before has left
    assert run(make, [], lambda: True) == 0
    sys.setswitchinterval(before)
    assert found[0] < 1e-3
    assert gc.get_freeze_count() > frozen
    gc.unfreeze()


def test_help_lists_the_scene_and_every_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert execute(DynamicsNode, DynamicsParams, ["--help"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("usage: dynamics [SCENE] [--ros-args -p NAME:=VALUE")
    assert "\n  scene = ''\n" in told


def test_help_behind_ros_arguments_is_theirs() -> None:
    assert split_words(("panda", "--ros-args", "--help")) == ("panda", ("--ros-args", "--help"))
    with pytest.raises(InvalidInput, match="neither the scene"):
        split_words(("panda", "--help"))
