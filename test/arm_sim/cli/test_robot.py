# SPDX-License-Identifier: Apache-2.0
"""``./arm go``, ``set``, ``get`` and ``watch`` with a simulator and a controller that run."""

import json
import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import click
import pytest
from builtin_interfaces.msg import Time
from click.testing import CliRunner
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from forging import running
from sensor_msgs.msg import JointState
from typist import Result

import models
from arm_dynamics.ros.interfaces import JOINT_STATES
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import JointTrajectory, Waypoint, quintic
from arm_sim.cli.main import main
from arm_sim.cli.robot import go
from arm_sim.cli.robot.controller import Controller
from arm_sim.cli.robot.go import LEAST, parse, targets, unhurried
from arm_sim.cli.robot.listener import Listener
from arm_sim.cli.robot.watch import WatchedArm

SCENE = str(models.SCENES / "two_link.yaml")
Shell = Callable[..., Result]


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
    assert unhurried({"a": 1e-6, "b": 1.0}, {"a": 0.0}) == LEAST


ros = pytest.mark.ros


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[int]:
    """A domain in which a simulator and a controller run."""
    logs = tmp_path_factory.mktemp("log")
    with running(forge, logs, ("sim", SCENE), ("controller", SCENE)) as number:
        yield number


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Shell:
    """Types a command in a domain."""

    def typed(domain: int, *words: str) -> Result:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        with pytest.raises(SystemExit) as end:
            main([*words, "--timeout", "20"])
        return Result(int(end.value.code or 0), "".join(capfd.readouterr()))

    return typed


def positions(shell: Shell, domain: int) -> dict[str, float]:
    said = json.loads(shell(domain, "watch", "--once", "--json").output)
    return dict(zip(said["names"], said["position"], strict=True))


@ros
def test_joints_go_where_they_are_sent(shell: Shell, domain: int) -> None:
    done = shell(domain, "go", "shoulder=-0.2", "elbow=0.6", "--duration", "0.4")
    assert done.exit_code == 0, done.output
    assert "elbow" in done.output and "arrived: largest error" in done.output
    done = shell(domain, "go", "shoulder+=0.1", "--duration", "0.3")
    assert done.exit_code == 0, done.output
    there = positions(shell, domain)
    assert there == pytest.approx({"shoulder": -0.1, "elbow": 0.6}, abs=1e-3)


@ros
def test_joints_go_to_the_start_of_a_file_and_along_it(
    shell: Shell, domain: int, tmp_path: Path
) -> None:
    points = [Waypoint(0.0, [0.1, 0.4]), Waypoint(0.3, [0.3, 0.5]), Waypoint(0.6, [0.15, 0.7])]
    path = JointTrajectory.of(quintic(points), ["shoulder", "elbow"]).save(tmp_path / "a.yaml")
    done = shell(domain, "go", "--trajectory", str(path))
    assert done.exit_code == 0, done.output
    assert "3 points in 0.6 s" in done.output and done.output.count("arrived") == 2
    there = positions(shell, domain)
    assert there == pytest.approx({"shoulder": 0.15, "elbow": 0.7}, abs=1e-3)
    path = JointTrajectory.of(quintic(points), ["wrist", "elbow"]).save(tmp_path / "b.yaml")
    done = shell(domain, "go", "--trajectory", str(path))
    assert done.exit_code == 1 and "unknown joints wrist; allowed: shoulder" in done.output


@ros
def test_what_the_arm_cannot_do_is_refused(shell: Shell, domain: int) -> None:
    before = positions(shell, domain)
    done = shell(domain, "go", "elbow=9", "--duration", "0.2")
    assert done.exit_code == 1 and "elbow to 9" in done.output
    assert "refused: " in done.output and "→" not in done.output
    done = shell(domain, "go", "shoulder=0.1", "elbo=0.1")
    assert done.exit_code == 1
    assert "unknown joints elbo; allowed: shoulder, elbow; did you mean 'elbow'?" in done.output
    assert positions(shell, domain) == pytest.approx(before, abs=1e-4)


@ros
def test_a_frame_goes_to_a_pose(shell: Shell, domain: int) -> None:
    done = shell(domain, "go", "--pose", "0.7 0 0 0 0 0 1")
    assert done.exit_code == 1 and "no task_frame; set one with --frame" in done.output
    assert shell(domain, "set", "controller", "task_axes", "x z").exit_code == 0
    x, y, z = TaskSpace(models.dynamics("two_link"), "tip").pose([-0.4, 0.8]).position
    done = shell(domain, "go", "--frame", "tip", "--pose", f"{x} {y} {z} 0 0 0 1")
    assert done.exit_code == 0, done.output
    assert positions(shell, domain) == pytest.approx({"shoulder": -0.4, "elbow": 0.8}, abs=1e-3)
    done = shell(domain, "go", "--pose", "5 0 0 0 0 0 1")
    assert done.exit_code == 1 and "cannot be brought to" in done.output


@ros
def test_parameters_are_shown_and_set(shell: Shell, domain: int) -> None:
    said = shell(domain, "get").output.split()
    assert {"/sim", "/controller"} <= set(said)
    said = shell(domain, "get", "controller").output
    assert re.search(r"bandwidth +\[20\.0\] +double\[\].*Bandwidth of the error", said)
    assert re.search(r"switch_time +0\.2 +double +0 to 60, fixed", said)
    done = shell(domain, "set", "controller", "bandwidth", "30", "observer", "1e1")
    assert done.exit_code == 0 and "observer: 0.0 → 10.0" in done.output
    assert "bandwidth: [20.0] → 30.0\n" in done.output
    values = json.loads(shell(domain, "get", "controller", "observer", "--json").output)
    assert values == {"observer": 10.0}
    assert shell(domain, "set", "controller", "observer", "0", "bandwidth", "20").exit_code == 0


REFUSED = {
    ("set", "controller", "bandwith", "30"): "did you mean 'bandwidth'?",
    ("set", "controller", "bandwidth", "-1", "observer", "3"): "refused: .*bandwidth",
    ("set", "controller", "switch_time", "1"): "restart controller with --ros-args -p switch_ti",
    ("set", "controller", "bandwidth", "{a: 1}"): "not a parameter value",
    ("get", "controller", "kp"): "'kp'; did you mean 'bandwidth'[?] allowed: ",
}


@ros
def test_what_a_node_does_not_take_is_refused(shell: Shell, domain: int) -> None:
    before = shell(domain, "get", "controller", "--json").output
    for words, said in REFUSED.items():
        done = shell(domain, *words)
        assert done.exit_code == 1 and re.search(said, done.output), done.output
    assert shell(domain, "get", "controller", "--json").output == before


@ros
def test_joints_are_watched(shell: Shell, domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    with Listener() as second:
        second.publisher(JOINT_STATES, "/joint_states")
        said = shell(domain, "watch", "--once").output
    assert re.search("only the newest of the joint states of /arm_shell_.*, /sim are shown", said)
    said = shell(domain, "watch", "--once").output
    assert said.endswith("\n") and "newest" not in said
    assert re.search(r"shoulder +-?\d\.\d{5} +-?\d\.\d{5} +-?\d+\.\d{5}", said)
    assert re.search(r"\d joint states/s", said)


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
    status.values = [KeyValue(key="at stops", value="a")]
    seen.reports.on_diagnostics(DiagnosticArray(status=[status]))
    now[0] += 2.0
    assert seen.rate == 0.0
    assert seen.remarks() == [
        "stale: no joint state for 2.0 s",
        "sim: x: oh",
        "sim: x: at stops: a",
    ]


class Answering:
    """A controller whose motion ends as its name says, for ``go``."""

    reference, remaining, send_trajectory = {"elbow": 0.0}, 0.0, print
    errors = ["controller: controller: two nodes publish /joint_states"]

    def __init__(self, node: str, timeout: float) -> None:
        self.outcome = node
        self.replaced = not node.startswith("off by ")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def wait_for_state(self) -> None: ...

    def begin(self, send: object) -> str:
        return "following 1 points for 1.000 s"

    def motion(self) -> Iterator[float]:
        return iter(())

    def settle(self, tolerance: float, patience: float) -> tuple[str, float]:
        return "elbow", 0.0 if self.replaced else float(self.outcome.removeprefix("off by "))


@pytest.mark.parametrize(
    ("outcome", "code", "said"),
    [
        ("the motion ended, time went backwards; the arm is held", 1, "reached: the motion ended"),
        ("following 2 points for 3.000 s", 1, "reached: another goal has replaced it, following"),
        ("planning Cartesian goal: a straight line", 1, "another goal has replaced it, planning"),
        ("", 1, "not reached: the controller holds the arm"),
        ("off by 0.01", 0, "arrived"),
        ("off by 0.011", 1, "stopped short: elbow is off by"),
        ("off by nan", 1, "stopped short: elbow is off by"),
    ],
)
def test_only_an_arm_that_ends_where_it_was_sent_has_arrived(
    monkeypatch: pytest.MonkeyPatch, outcome: str, code: int, said: str
) -> None:
    """Else the one reason is given."""
    monkeypatch.setattr("arm_sim.cli.robot.controller.Controller", Answering)
    done = CliRunner().invoke(go, ["elbow=1", "--controller", outcome])
    assert done.exit_code == code and said in done.output
    if outcome.startswith("off by"):
        assert Answering.errors[0] in done.output


class Told(Controller):
    """A controller's client that is told one state after another."""

    def __init__(self, *states: SimpleNamespace) -> None:
        self.states, self._count, self._target, self._timeout = list(states), 0, {}, 1.0
        self._on_state(self.states.pop(0))

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        while not (met := condition()) and self.states:
            self._on_state(self.states.pop(0))
        return met


def told(goal: str = "", remaining: float = 0.0, at: int = 0, **numbers: Any) -> SimpleNamespace:
    """What a controller says of two joints at a time in [s]."""
    names = ("reference_position", "position_error", "velocity_error")
    given = {name: numbers.get(name, (0.0, 0.0)) for name in names}
    header = SimpleNamespace(stamp=Time(sec=at))
    joints = ("shoulder", "elbow")
    return SimpleNamespace(
        joint_names=joints, goal=goal, remaining=remaining, header=header, **given
    )


def test_an_arm_has_settled_when_no_joint_is_off_or_moves() -> None:
    for joint, sign in (0, 1.0), (1, -1.0):
        one = [sign * (i == joint) for i in range(2)]
        off, moves = told(position_error=one), told(velocity_error=one)
        near = told(position_error=[1e-3 * x for x in one])
        listener = Told(off, moves, near, told())
        name = near.joint_names[joint]
        assert listener.settle(0.01, 1.0) == (name, pytest.approx(1e-3))
        assert len(listener.states) == 1
        assert Told(moves, off).settle(0.01, 1.0) == (name, 1.0)


def test_a_motion_is_replaced_when_any_joint_ends_elsewhere() -> None:
    for reference, replaced in ((0.1, 0.2), False), ((0.1, 0.3), True), ((0.0, 0.2), True):
        controller = Told(told(reference_position=reference))
        assert not controller.replaced
        controller._target = {"shoulder": 0.1, "elbow": 0.2}
        assert controller.replaced is replaced


OLD = "following 1 points for 3.000 s"


@pytest.mark.parametrize(
    ("states", "words"),
    [
        ([told("planning a path"), told("following 9 poses")], "following 9 poses"),
        ([told(OLD, 1.0, at=2), told(OLD, 0.0, at=4), told(OLD, 3.0, at=5)], OLD),
        ([told(OLD, 1.0, at=2), told("planning 2", 0.5, at=2), told("path refused: x")], "x"),
        ([told(OLD, 1.0, at=2), told(OLD, 0.0, at=4)], "no answer to the goal"),
    ],
    ids=["planned", "the same again", "refused", "no answer"],
)
def test_a_goal_has_begun_when_another_motion_is_followed(
    states: list[SimpleNamespace], words: str
) -> None:
    """The same words may tell of another motion, which has more time left."""
    listener = Told(told(OLD, 2.0, at=1), *states)
    sent: list[bool] = []
    try:
        assert listener.begin(lambda: sent.append(True)) == words
    except click.ClickException as error:
        assert words in error.message
        assert "refused" in states[-1].goal or "no answer" in words
    assert sent == [True] and not listener.states


def test_points_after_the_first_are_sent_with_all_that_they_have(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent = list[Any]()
    monkeypatch.setattr(Controller, "_send", lambda _, topic, message: sent.append(message))
    points = (
        Waypoint(0.0, [0.0, 0.0]),
        Waypoint(1.5, [0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]),
        Waypoint(2.0, [1.0, 2.0]),
    )
    controller = Told(told())
    controller.send_trajectory(("elbow", "shoulder"), points[1:])
    (message,) = sent
    whole, bare = message.points
    assert message.joint_names == ["elbow", "shoulder"]
    assert [list(x) for x in (whole.positions, whole.velocities, whole.accelerations)] == [
        [0.1, 0.2], [0.3, 0.4], [0.5, 0.6]
    ]  # fmt: skip
    assert list(whole.effort) == [0.7, 0.8] and not len(bare.effort) + len(bare.velocities)
    assert (whole.time_from_start.sec, whole.time_from_start.nanosec) == (1, 500_000_000)
    assert controller._target == {"elbow": 1.0, "shoulder": 2.0}


@ros
def test_who_is_not_there_is_named(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], domain: int
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    for words, said in (
        (["go", "elbow=0", "--controller", "left/controller"], "no controller /left/controller"),
        (["watch", "--topic", "left/joint_states"], "no joint states on /left/joint_states"),
        (["get", "left/sim"], "no node offers /left/sim/list_parameters"),
    ):
        with pytest.raises(SystemExit) as end:
            main([*words, "--timeout", "1"])
        printed = "".join(capfd.readouterr())
        assert end.value.code == 1 and said in printed and "nodes seen: " in printed


@ros
def test_a_controller_without_a_robot_is_distinguished(
    tmp_path: Any, forge: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with running(forge, tmp_path, ("controller", SCENE)) as alone:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(alone))
        with Listener() as listener:
            assert listener.until(lambda: "/controller" in listener.nodes(), 20.0)
        with pytest.raises(SystemExit) as end:
            main(["go", "elbow=0", "--timeout", "2"])
    printed = "".join(capfd.readouterr())
    assert end.value.code == 1 and "answered no joint state for 2 s" in printed
    assert "\n  nothing publishes /joint_states; start a robot" in printed
