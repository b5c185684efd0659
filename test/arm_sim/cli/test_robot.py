# SPDX-License-Identifier: Apache-2.0
"""``./arm go``, ``set``, ``get`` and ``watch`` with a simulator and a controller that run."""

import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import click
import pytest
from arm_msgs.msg import TrackingState
from click.testing import CliRunner
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from forging import running
from sensor_msgs.msg import JointState
from typist import Typist, answer

import models
from arm_dynamics.ros.interfaces import JOINT_STATES
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import JointTrajectory, Waypoint, quintic
from arm_sim.cli.robot import go
from arm_sim.cli.robot.controller import Controller
from arm_sim.cli.robot.go import SHORTEST_MOTION, parse, targets, unhurried
from arm_sim.cli.robot.listener import Listener
from arm_sim.cli.robot.watch import WatchedArm

SCENE = str(models.SCENES / "two_link.yaml")


def test_goals_are_positions_or_distances() -> None:
    """Of joints without a reference the controller decides; they may follow others."""
    goals = parse(["elbow=-0.5", "a+=1e-1", "b-=.2", "slash/joint=3", "hand+=0.2"])
    here = {"elbow": 1.0, "a": 2.0, "b": 3.0, "slash/joint": 4.0, "other": 5.0}
    there = targets(goals, here)
    assert there == {"elbow": -0.5, "a": 2.1, "b": 2.8, "slash/joint": 3.0, "hand": 0.2}


def test_no_joint_hurries_when_no_duration_is_given() -> None:
    """A quintic from rest to rest is fastest in its middle, at 15/8 of its mean speed."""
    seconds = unhurried({"a": 2.0, "b": 0.0}, {"a": -1.0, "b": 0.5})
    assert 15.0 / 8.0 * 3.0 / seconds == pytest.approx(1.0)
    assert unhurried({"a": 1e-6, "b": 1.0}, {"a": 0.0}) == SHORTEST_MOTION


ros = pytest.mark.ros


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[int]:
    """A domain in which a simulator and a controller run, and one that no robot answers."""
    alone = "controller", SCENE, "--ros-args", "-r", "__ns:=/alone"
    logs = tmp_path_factory.mktemp("log")
    with running(forge, logs, ("sim", SCENE), ("controller", SCENE), alone) as number:
        yield number


@pytest.fixture
def shell(
    domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Typist:
    """Types commands in the domain of the nodes."""
    return Typist(domain, monkeypatch, capfd, ())


def positions(shell: Typist) -> dict[str, float]:
    said = answer(shell("watch", "--once", "--json"))
    return dict(zip(said["names"], said["position"], strict=True))


@ros
def test_joints_go_where_they_are_sent(shell: Typist) -> None:
    done = shell("go", "shoulder=-0.2", "elbow=0.6", "--duration", "0.4")
    assert done.exit_code == 0, done.output
    assert "elbow" in done.output and "arrived: largest error" in done.output
    done = shell("go", "shoulder+=0.1", "--duration", "0.3")
    assert done.exit_code == 0, done.output
    assert positions(shell) == pytest.approx({"shoulder": -0.1, "elbow": 0.6}, abs=1e-3)


@ros
def test_joints_go_to_the_start_of_a_file_and_along_it(shell: Typist, tmp_path: Path) -> None:
    points = [Waypoint(0.0, [0.1, 0.4]), Waypoint(0.3, [0.3, 0.5]), Waypoint(0.6, [0.15, 0.7])]
    path = JointTrajectory.of(quintic(points), ["shoulder", "elbow"]).save(tmp_path / "a.yaml")
    done = shell("go", "--trajectory", str(path))
    assert done.exit_code == 0, done.output
    assert "3 points in 0.6 s" in done.output and done.output.count("arrived") == 2
    assert positions(shell) == pytest.approx({"shoulder": 0.15, "elbow": 0.7}, abs=1e-3)
    path = JointTrajectory.of(quintic(points), ["wrist", "elbow"]).save(tmp_path / "b.yaml")
    done = shell("go", "--trajectory", str(path))
    assert done.exit_code == 1 and "unknown joints wrist; allowed: shoulder" in done.output


@ros
def test_what_the_arm_cannot_do_is_refused(shell: Typist) -> None:
    before = positions(shell)
    done = shell("go", "elbow=9", "--duration", "0.2")
    assert done.exit_code == 1 and "elbow to 9" in done.output
    assert "refused: " in done.output and "→" not in done.output
    done = shell("go", "shoulder=0.1", "elbo=0.1")
    assert done.exit_code == 1
    assert "unknown joints elbo; allowed: shoulder, elbow; did you mean 'elbow'?" in done.output
    assert positions(shell) == pytest.approx(before, abs=1e-4)


@ros
def test_a_frame_goes_to_a_pose(shell: Typist) -> None:
    done = shell("go", "--pose", "0.7 0 0 0 0 0 1")
    assert done.exit_code == 1 and "no task_frame; set one with --frame" in done.output
    assert shell("set", "controller", "task_axes", "x z").exit_code == 0
    x, y, z = TaskSpace(models.dynamics("two_link"), "tip").pose([-0.4, 0.8]).position
    done = shell("go", "--frame", "tip", "--pose", f"{x} {y} {z} 0 0 0 1")
    assert done.exit_code == 0, done.output
    assert positions(shell) == pytest.approx({"shoulder": -0.4, "elbow": 0.8}, abs=1e-3)
    done = shell("go", "--pose", "5 0 0 0 0 0 1")
    assert done.exit_code == 1 and "cannot be brought to" in done.output


@ros
def test_parameters_are_shown_and_set(shell: Typist) -> None:
    assert {"/sim", "/controller"} <= set(shell("get").output.split())
    said = shell("get", "controller").output
    assert re.search(r"switch_time +0\.2 +double +0 to 60, fixed", said)
    done = shell("set", "controller", "bandwidth", "30", "observer", "1e1")
    assert done.exit_code == 0 and "observer: 0.0 → 10.0" in done.output
    assert "bandwidth: [20.0] → 30.0\n" in done.output
    assert answer(shell("get", "controller", "observer", "--json")) == {"observer": 10.0}
    assert shell("set", "controller", "observer", "0", "bandwidth", "20").exit_code == 0


REFUSED = {
    ("set", "controller", "bandwith", "30"): "did you mean 'bandwidth'?",
    ("set", "controller", "bandwidth", "-1", "observer", "3"): "refused: .*bandwidth",
    ("set", "controller", "switch_time", "1"): "restart controller with --ros-args -p switch_ti",
    ("set", "controller", "bandwidth", "{a: 1}"): "not a parameter value",
    ("get", "controller", "kp"): "'kp'; did you mean 'bandwidth'[?] allowed: ",
}


@ros
def test_what_a_node_does_not_take_is_refused(shell: Typist) -> None:
    before = shell("get", "controller", "--json").output
    for words, said in REFUSED.items():
        done = shell(*words)
        assert done.exit_code == 1 and re.search(said, done.output), done.output
    assert shell("get", "controller", "--json").output == before


@ros
def test_joints_are_watched(shell: Typist) -> None:
    """Those of the newest of several publishers, which is told."""
    with Listener() as second:
        second.publisher(JOINT_STATES, "/joint_states")
        said = shell("watch", "--once").output
    assert re.search("only the newest of the joint states of /arm_shell_.*, /sim are shown", said)
    assert re.search(r"shoulder +-?\d\.\d{5} +-?\d\.\d{5} +-?\d+\.\d{5}", said)


def test_rate_and_silence_of_joint_states_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [10.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    seen = WatchedArm("/joint_states")
    for _ in range(101):
        now[0] += 0.004
        seen.on_state(JointState(name=["a", "b"], position=[1.0, -0.0]))
    assert seen.rate == pytest.approx(250.0) and seen.remarks() == []
    assert seen.rows()[1][:2] == ("b", 0.0) and math.isnan(seen.rows()[0][3])
    status = DiagnosticStatus(level=DiagnosticStatus.WARN, name="sim: x", message="oh")
    seen.reports.on_diagnostics(DiagnosticArray(status=[status]))
    now[0] += 2.0
    assert seen.rate == 0.0
    assert seen.remarks() == ["stale: no joint state for 2.0 s", "sim: x: oh"]


@pytest.mark.parametrize(("outcome", "off", "said"), [
    ("the motion ended, time went backwards; the arm is held", None, "reached: the motion en"),
    ("following 2 points for 3.000 s", None, "reached: another goal has replaced it, followi"),
    ("", None, "not reached: the controller holds the arm"),
    ("", 0.01, "arrived"),
    ("", 0.011, "stopped short: elbow is off by"),
    ("", math.nan, "stopped short: elbow is off by"),
])  # fmt: skip
def test_only_an_arm_that_ends_where_it_was_sent_has_arrived(
    monkeypatch: pytest.MonkeyPatch, outcome: str, off: float | None, said: str
) -> None:
    """Else the one reason is given: another goal, or how far off a joint is."""
    controller = MagicMock(reference={"elbow": 0.0}, remaining=0.0, outcome=outcome)
    controller.errors = ["why"]
    controller.__enter__.return_value, controller.replaced = controller, off is None
    controller.begin.return_value = "following 1 points for 1.000 s"
    controller.settle.return_value = "elbow", off
    monkeypatch.setattr("arm_sim.cli.robot.controller.Controller", lambda *_: controller)
    done = CliRunner().invoke(go, ["elbow=1"])
    assert done.exit_code == int(said != "arrived")
    assert said in done.output and "why" in done.output


class Told(Controller):
    """A controller's client that is told one state after another."""

    def __init__(self, *states: TrackingState) -> None:
        self.states, self._count, self._target, self._timeout = list(states), 0, {}, 1.0
        self._on_state(self.states.pop(0))

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        while not (met := condition()) and self.states:
            self._on_state(self.states.pop(0))
        return met


def told(goal: str = "", remaining: float = 0.0, at: int = 0, **numbers: Any) -> TrackingState:
    """What a controller says of two joints at a time in [s]."""
    state = TrackingState(joint_names=["shoulder", "elbow"], goal=goal, remaining=remaining)
    state.header.stamp.sec = at
    for name in ("reference_position", "position_error", "velocity_error"):
        setattr(state, name, numbers.get(name, (0.0, 0.0)))
    return state


def test_an_arm_has_settled_when_no_joint_is_off_or_moves() -> None:
    off, moves = told(position_error=(0.0, -1.0)), told(velocity_error=(0.0, -1.0))
    near = told(position_error=(0.0, -1e-3))
    listener = Told(off, moves, near, told())
    assert listener.settle(0.01, 1.0) == ("elbow", 1e-3)
    assert len(listener.states) == 1
    assert Told(moves, off).settle(0.01, 1.0) == ("elbow", 1.0)


def test_a_motion_is_replaced_when_any_joint_ends_elsewhere() -> None:
    for reference, replaced in ((0.1, 0.2), False), ((0.1, 0.3), True), ((0.0, 0.2), True):
        controller = Told(told(reference_position=reference))
        assert not controller.replaced
        controller._target = {"shoulder": 0.1, "elbow": 0.2}
        assert controller.replaced is replaced


OLD = "following 1 points for 3.000 s"


def begun(*states: TrackingState) -> str:
    listener, sent = Told(told(OLD, 2.0, at=1), *states), list[bool]()
    try:
        return listener.begin(lambda: sent.append(True))
    finally:
        assert sent == [True] and not listener.states


def test_a_goal_has_begun_when_another_motion_is_followed() -> None:
    """The same words may tell of another motion, which has more time left."""
    assert begun(told("planning a path"), told("following 9 poses")) == "following 9 poses"
    old = told(OLD, 1.0, at=2), told(OLD, 0.0, at=4)
    assert begun(*old, told(OLD, 3.0, at=5)) == OLD
    with pytest.raises(click.ClickException, match="path refused: x"):
        begun(*old, told("path refused: x"))
    with pytest.raises(click.ClickException, match="no answer to the goal"):
        begun(*old)


@ros
def test_who_is_not_there_is_named(shell: Typist) -> None:
    alone = shell("go", "elbow=0", "--controller", "alone/controller", timeout=9.0)
    nothing = (
        "answered no joint state for 9 s\n  nothing publishes /alone/joint_states; start a robot"
    )
    assert alone.exit_code == 1 and nothing in alone.output
    for line, said in (
        ("go elbow=0 --controller left/controller", "no controller /left/controller"),
        ("watch --topic left/joint_states", "no joint states on /left/joint_states"),
        ("get left/sim", "no node offers /left/sim/list_parameters"),
    ):
        done = shell(*line.split(), timeout=1.0)
        assert done.exit_code == 1 and said in done.output and "nodes seen: " in done.output
