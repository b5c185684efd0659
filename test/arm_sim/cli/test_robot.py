# SPDX-License-Identifier: Apache-2.0
"""``./arm go``, ``set``, ``get`` and ``watch`` with a simulator and a controller that run."""

import io
import json
import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import click
import pytest
from builtin_interfaces.msg import Time
from click.testing import CliRunner
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from forging import running
from rich.console import Console
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
from arm_sim.cli.robot.reports import Reports
from arm_sim.cli.robot.watch import WatchedArm, _json, _line, _picture

SCENE = str(models.SCENES / "two_link.yaml")
Shell = Callable[..., Result]


# --- goals of joints ---------------------------------------------------------------------------


def test_goals_are_positions_or_distances() -> None:
    goals = parse(["elbow=-0.5", "a+=1e-1", "b-=.2", "slash/joint=3"])
    here = {"elbow": 1.0, "a": 2.0, "b": 3.0, "slash/joint": 4.0, "other": 5.0}
    there = targets(goals, here)
    assert there == {"elbow": -0.5, "a": 2.1, "b": 2.8, "slash/joint": 3.0}


def test_the_controller_decides_about_joints_without_a_reference() -> None:
    """They may follow others, of which it knows."""
    goals, here = parse(["left=0.03", "right=-0.01", "hand+=0.2"]), {"left": 0.01}
    there = targets(goals, here)
    assert there == {"left": 0.03, "right": -0.01, "hand": 0.2}
    assert unhurried(there, here) == unhurried({"right": 1.0}, here) == LEAST


def test_no_joint_hurries_when_no_duration_is_given() -> None:
    """A quintic from rest to rest is fastest in its middle, at 15/8 of its mean speed."""
    seconds = unhurried({"a": 2.0, "b": 0.0}, {"a": -1.0, "b": 0.5})
    assert 15.0 / 8.0 * 3.0 / seconds == pytest.approx(1.0)
    assert unhurried({"a": 1e-6}, {"a": 0.0}) == 1.0


# --- with nodes --------------------------------------------------------------------------------

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
    there = positions(shell, domain)
    assert there == pytest.approx({"shoulder": -0.2, "elbow": 0.6}, abs=1e-3)
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
    shell(domain, "go", "shoulder=-0.5", "elbow=0.9", "--duration", "0.3")
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
    assert shell(domain, "set", "controller", "bandwidth", "much").exit_code == 1
    assert shell(domain, "set", "controller", "observer", "0", "bandwidth", "20").exit_code == 0


REFUSED = {
    ("set", "controller", "bandwith", "30"): "did you mean 'bandwidth'?",
    ("set", "controller", "bandwidth", "-1", "observer", "3"): "refused: .*bandwidth",
    ("set", "controller", "controller", "os:system"): "refused: .*when the node is started",
    ("set", "controller", "switch_time", "1"): "restart controller with --ros-args -p switch_ti",
    ("set", "controller", "switch_time", "-1"): r"switch_time is -1\S*; allowed: 0 to 60",
    ("set", "controller", "bandwidth", "{a: 1}"): "not a parameter value",
    ("get", "controller", "q"): "has no parameter 'q'",
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


def test_states_are_shown_as_a_table_a_line_or_json(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [10.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    seen = WatchedArm("/joint_states")
    for k in range(60):
        assert seen.measured == (k >= 50)
        now[0] += 0.002
        state = JointState(name=["a", "b"], position=[1.0, -1e-7], velocity=[-2.5, 0.25])
        state.header.stamp.sec, state.header.stamp.nanosec = 3, 250_000_000
        seen.on_state(state)
    status = DiagnosticStatus(level=DiagnosticStatus.OK, name="sim: x", message="all is well")
    status.values = [KeyValue(key="held", value="b"), KeyValue(key="at stops", value="none")]
    seen.reports.on_diagnostics(DiagnosticArray(status=[status]))
    assert _line(seen) == "3.250 a=1.00000 b=0.00000; sim: x: held: b"
    assert json.loads(_json(seen)) == {
        "time": 3.25, "rate": pytest.approx(500.0), "remarks": ["sim: x: held: b"],
        "names": ["a", "b"], "position": [1.0, -1e-7], "velocity": [-2.5, 0.25],
        "effort": [None, None],
    }  # fmt: skip
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(_picture(seen))
    lines = console.export_text().splitlines()
    assert [line.split() for line in lines if line.startswith((" a", " b"))] == [
        ["a", "1.00000", "-2.50000", "-"], ["b", "0.00000", "0.25000", "-"]
    ]  # fmt: skip
    assert " t = 3.250 s, 500 joint states/s" in lines and lines[-1] == " sim: x: held: b"


class Interrupted:
    """A controller whose motion ends elsewhere, for ``go``."""

    reference, remaining, replaced, send_trajectory = {"elbow": 0.0}, 0.0, True, print
    errors = ["controller: controller: two nodes publish /joint_states"]

    def __init__(self, node: str, timeout: float) -> None:
        self.outcome = node  # which is here the cause

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def wait_for_state(self) -> None: ...

    def begin(self, send: object) -> str:
        return "following 1 points for 1.000 s"

    def motion(self) -> Iterator[float]:
        return iter(())

    def settle(self, tolerance: float, patience: float) -> tuple[str, float]:
        return "elbow", 0.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("the motion ended, time went backwards; the arm is held where it is", "reached: the mot"),
        ("following 2 points for 3.000 s", "reached: another goal has replaced it, following 2"),
        ("planning Cartesian goal: a straight line", "another goal has replaced it, planning Car"),
        ("", "not reached: the controller holds the arm"),
    ],
)
def test_the_one_reason_why_a_motion_ended_elsewhere_is_given(
    monkeypatch: pytest.MonkeyPatch, words: str, said: str
) -> None:
    monkeypatch.setattr("arm_sim.cli.robot.controller.Controller", Interrupted)
    done = CliRunner().invoke(go, ["elbow=1", "--controller", words])
    assert done.exit_code == 1 and said in done.output


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


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_arm_has_settled_when_no_joint_is_off_or_moves(joint: int, sign: float) -> None:
    one = [sign * (i == joint) for i in range(2)]
    off, moves = told(position_error=one), told(velocity_error=one)
    near = told(position_error=[1e-3 * x for x in one])
    listener = Told(off, moves, near, told())
    name = near.joint_names[joint]
    assert listener.settle(0.01, 1.0) == (name, pytest.approx(1e-3))
    assert len(listener.states) == 1
    assert Told(moves, off).settle(0.01, 1.0) == (name, 1.0)


@pytest.mark.parametrize(
    ("reference", "replaced"),
    [((0.1, 0.2), False), ((0.1, 0.3), True), ((0.0, 0.2), True), ((0.0, 0.0), True)],
)
def test_a_motion_is_replaced_when_any_joint_ends_elsewhere(
    reference: tuple[float, float], replaced: bool
) -> None:
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


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Messages that a client sends."""
    messages: list[Any] = []
    monkeypatch.setattr(Controller, "_send", lambda _, topic, message: messages.append(message))
    return messages


def test_goals_are_sent_by_name_with_their_times(sent: list[Any]) -> None:
    controller = Told(told())
    controller.send_trajectory(("elbow", "shoulder"), [Waypoint(2.000000001, [0.5, -1.0])])
    (message,) = sent
    (point,) = message.points
    assert (message.joint_names, list(point.positions)) == (["elbow", "shoulder"], [0.5, -1.0])
    assert (point.time_from_start.sec, point.time_from_start.nanosec) == (2, 1)
    assert controller._target == {"elbow": 0.5, "shoulder": -1.0}


def test_points_after_the_first_are_sent_with_all_that_they_have(sent: list[Any]) -> None:
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


def test_a_pose_is_sent_in_its_order(sent: list[Any]) -> None:
    Told(told()).send_pose([1, 2, 3, 4, 5, 6, 7])
    at, turn = sent[0].pose.position, sent[0].pose.orientation
    assert [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w] == [1, 2, 3, 4, 5, 6, 7]


class Short(Interrupted):
    """A controller whose arm stays away from its reference."""

    replaced = False

    def settle(self, tolerance: float, patience: float) -> tuple[str, float]:
        return "elbow", float(self.outcome)


@pytest.mark.parametrize(("error", "code"), [("0.01", 0), ("0.011", 1), ("nan", 1)])
def test_an_arm_that_stops_short_has_not_arrived(
    monkeypatch: pytest.MonkeyPatch, error: str, code: int
) -> None:
    monkeypatch.setattr("arm_sim.cli.robot.controller.Controller", Short)
    done = CliRunner().invoke(go, ["elbow=1", "--controller", error])
    assert done.exit_code == code
    assert ("arrived" if code == 0 else "stopped short: elbow is off by") in done.output
    assert Short.errors[0] in done.output


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
            main(["go", "elbow=0", "--timeout", "4"])
    printed = "".join(capfd.readouterr())
    assert end.value.code == 1 and "answered no joint state for 4 s" in printed
    assert "\n  nothing publishes /joint_states; start a robot" in printed


class Left(Controller):
    """A client in a graph of these nodes, with publishers of one topic."""

    def __init__(self, nodes: Sequence[str], publishers: int, reports: Reports) -> None:
        self._nodes, self._publishers, self._reports = nodes, publishers, reports
        self._name, self._space = "/left/controller", "/left"

    def nodes(self) -> Sequence[str]:
        return self._nodes

    def publishers(self, name: str) -> int:
        return self._publishers if name == "/left/joint_states" else 0


def status(name: str, level: bytes, message: str, **values: str) -> DiagnosticStatus:
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(name=name, level=level, message=message, values=pairs)


SILENT = status("left/controller: controller", b"\2", "no joint state for 5.0 s")
FAILED = status("left/controller: controller", b"\2", "the controller 'mine' has failed: oh")
PAUSED = status("left/sim: simulation", b"\0", "ok", paused="true")
OTHER = status("sim: simulation", b"\2", "diverged", paused="true")


@ros
@pytest.mark.parametrize(
    ("reported", "nodes", "publishers", "said"),
    [
        ([PAUSED, SILENT], ["/left/controller"], 1, "the simulation is paused; ./arm call resume"),
        ([OTHER], [], 1, "the controller has ended; start it again"),
        ([OTHER, SILENT], ["/left/controller"], 0, "nothing publishes /left/joint_states"),
        ([OTHER, FAILED], ["/left/controller"], 1, "left/controller: controller: the controller"),
        ([SILENT], ["/left/controller"], 1, "/left/joint_states has a publisher, but no state"),
    ],
)
def test_go_names_the_one_cause(
    reported: list[DiagnosticStatus], nodes: list[str], publishers: int, said: str
) -> None:
    reports = Reports()
    reports.on_diagnostics(DiagnosticArray(status=reported))
    controller = Left(nodes, publishers, reports)
    assert controller._cause().startswith(said)
    assert [line.partition(": ")[0] for line in controller.errors] == [
        status.name.partition(": ")[0]
        for status in reported
        if status.level == DiagnosticStatus.ERROR and status not in (OTHER, SILENT)
    ]
