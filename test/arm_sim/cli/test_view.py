# SPDX-License-Identifier: Apache-2.0
"""``./arm view``: what it shows, what it refuses, and arms of running nodes."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import ANY, MagicMock, Mock, call

import numpy as np
import pytest
from arm_msgs.msg import Energy, TrackingState
from click import BadParameter
from forging import running
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

import models
from arm_sim.cli.main import main
from arm_sim.cli.robot.listener import Listener
from arm_sim.cli.view import command, live
from arm_sim.cli.view.command import Size
from arm_sim.exceptions import ViewError
from arm_sim.view.charts import Sample
from arm_sim.view.drawn_arm import DrawnArm
from arm_sim.view.marks import Instant

SCENE = str(models.SCENES / "two_link.yaml")
TWO_LINK = models.SCENES / "two_link.urdf"
START = "initial: {position: {shoulder: 0.4}}"
HERE = "127.0.0.1", 0
ros = pytest.mark.ros


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What would be shown, without a page."""
    kept: dict[str, Any] = {}
    monkeypatch.setattr("arm_sim.view.show", lambda *what, **more: kept.update(what=what, **more))
    return kept


def test_scenes_are_to_be_touched_side_by_side(shown: dict[str, Any]) -> None:
    command.page_of(["two_link", str(models.SCENES / "pendulum.yaml")], *HERE)
    assert shown["name"] == ["two_link", "pendulum"]
    assert [simulator.n for simulator in shown["what"]] == [2, 1]


def test_pictures_of_a_scene_are_of_a_motion(shown: dict[str, Any]) -> None:
    command.page_of(["two_link"], *HERE, motion=command.Motion(0.2, "weight"))
    (film,) = shown["what"]
    assert film.time[-1] == pytest.approx(0.2)
    np.testing.assert_allclose(film.q, np.tile(film.q[0], (201, 1)), atol=1e-9)


def test_an_arm_without_mass_is_shown(
    shown: dict[str, Any], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = re.sub("<inertial>.*?</inertial>", "", TWO_LINK.read_text(), flags=re.DOTALL)
    (tmp_path / "arm.urdf").write_text(text)
    command.page_of([str(tmp_path / "arm.urdf")], *HERE)
    (simulator,) = shown["what"]
    assert simulator.joint_names == ("shoulder", "elbow")
    simulator.set_state([0.3, 0.2], [0.0, 0.0])
    assert "shown with an armature of 1 at every joint" in caplog.text


def test_a_recording_of_a_robot_needs_its_scene(shown: dict[str, Any], tmp_path: Path) -> None:
    table = tmp_path / "robot.csv"
    table.write_text("time,position.elbow,position.shoulder\n0,0.1,0.2\n0.5,0.3,0.4\n")
    with pytest.raises(ViewError, match=r"robot.csv' contains no scene.*name it by --scene"):
        command.page_of([str(table)], *HERE)
    command.page_of([str(table)], *HERE, scene="two_link")
    np.testing.assert_array_equal(shown["what"][0].q, [[0.2, 0.1], [0.4, 0.3]])


def test_sizes_of_pictures_have_limits() -> None:
    assert Size().convert("16x4096", None, None) == (16, 4096)
    for text in "15x600", "600x4097", "600", "9.5x600", "600x-20":
        with pytest.raises(BadParameter, match="allowed: 16x16 to 4096x4096"):
            Size().convert(text, None, None)


@pytest.fixture
def page_of(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """Makes a page that notes what it is asked for."""
    made = MagicMock()
    made.return_value.url = "http://here"
    made.return_value.__enter__.return_value = made.return_value
    monkeypatch.setattr(command, "page_of", made)
    monkeypatch.setattr("arm_sim.view.pictures.browser", lambda: "one that draws")
    return made


@pytest.mark.group("view")
def test_a_page_stays_open_until_it_is_ended(
    page_of: MagicMock, capfd: pytest.CaptureFixture[str]
) -> None:
    main(["view", "two_link", "--host", "0.0.0.0", "--port", "9000", "--scene", "ur10",
          "--topic", "/a"], standalone_mode=False)  # fmt: skip
    page_of.assert_called_once_with(("two_link",), "0.0.0.0", 9000, None, "ur10", "/a", ANY)
    page_of.return_value.wait.assert_called_once_with()
    page_of.return_value.__exit__.assert_called_once()
    assert capfd.readouterr().out == "http://here  (Ctrl-C ends)\n"


@pytest.mark.group("view")
def test_pictures_are_written_as_they_are_asked_for(
    page_of: MagicMock, capfd: pytest.CaptureFixture[str]
) -> None:
    main(["view", "two_link", "--png", "a.png", "--gif", "a.gif", "--html", "a.html", "--mp4",
          "a.mp4", "--size", "320x200", "--time", "1.5", "--duration", "3", "--control", "weight",
          "--speed", "2", "--rate", "10", "--port", "9000"], standalone_mode=False)  # fmt: skip
    motion, size, page = (3.0, "weight"), (320, 200), page_of.return_value
    page_of.assert_called_once_with(("two_link",), "127.0.0.1", 0, motion, None, None, ANY)
    page.picture.assert_called_once_with(Path("a.png"), size, 1.5)
    films = [call(Path(name), size, 10.0, 2.0, ANY) for name in ("a.gif", "a.mp4")]
    assert page.film.call_args_list == films
    page.page.assert_called_once_with(Path("a.html"), 10.0, 2.0)
    page.wait.assert_not_called()
    assert capfd.readouterr().out.split() == ["a.png", "a.gif", "a.mp4", "a.html"]


@ros
def test_a_running_arm_is_followed_whatever_its_description_locks(
    tmp_path: Path, forge: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "_WAIT", 40.0)
    scene = tmp_path / "locked.yaml"
    urdf = models.SCENES / "two_link.urdf"
    scene.write_text(f"robot: {{urdf: {urdf}, lock: [elbow]}}\n{START}\n")
    with running(
        forge, tmp_path, ("sim", str(scene), "--ros-args", "-p", "paused:=true")
    ) as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        with Listener() as listener:
            arm = live.RunningArm(listener, "")
            model = arm.connect(None)
            assert model.joint_names == ("shoulder",)
            news = list[Any]()
            assert listener.until(lambda: bool(news.append(arm.newest()) or news[-1]), 40.0)
            np.testing.assert_array_equal(news[-1][1], [0.4])
            with pytest.raises(ViewError, match="another robot than the scene: it has no joint"):
                arm.connect(SCENE)


class Deaf:
    """A listener that hears nothing but what a test says."""

    def __init__(self) -> None:
        self.heard: dict[str, Any] = {}
        self.where = lambda: "nowhere"

    def subscribe(self, topic: Any, name: str, called: Any, **_: Any) -> None:
        self.heard[name] = called

    def until(self, condition: Any, timeout: float) -> bool:
        return bool(condition())


@ros
def test_news_are_those_of_the_scene_in_its_order() -> None:
    listener: Any = Deaf()
    arm, prefix = live.RunningArm(listener, "/left/arm/"), "/left/arm/"
    assert (arm.name, arm.topic) == ("left arm", "/left/arm/joint_states")

    def send(**parts: Any) -> None:
        state = JointState(**{"name": ["tool", "elbow", "shoulder"], **parts})
        state.header.stamp.sec, state.header.stamp.nanosec = 7, 500_000_000
        listener.heard[f"{prefix}joint_states"](serialize_message(state))

    def tell(**parts: Any) -> Any:
        send(**parts)
        return arm.newest()

    send()
    assert arm.connect(SCENE).joint_names == ("shoulder", "elbow")
    stamp, q, (torque, error, energy) = tell(position=[9.0, 0.2, 0.1], effort=[9.0, 2.0, 1.0])
    assert (stamp, q.tolist(), torque.tolist()) == (7.5, [0.1, 0.2], [1.0, 2.0])
    assert np.isnan([*error, *energy]).all()  # unknown
    control = TrackingState(joint_names=["elbow", "tool"], position_error=[0.5, 9.0])
    listener.heard[f"{prefix}controller/state"](control)
    listener.heard[f"{prefix}sim/energy"](Energy(kinetic=1.0, input=4.0, dissipated=5.0))
    _, _, (torque, error, energy) = tell(position=[9.0, 0.4, 0.3])
    np.testing.assert_array_equal([torque, error], [[np.nan, np.nan], [np.nan, 0.5]])
    assert energy.tolist() == [1.0, 0.0, 0.0, 4.0, 5.0]
    assert arm.newest() is None
    for position in ([9.0, 0.2], [9.0, np.nan, 0.1]):
        assert tell(position=position) is None


@pytest.mark.group("view")
@ros
def test_curves_and_silence_are_those_of_each_arm(
    server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From its first news on, or from where it began again."""
    monkeypatch.setattr(live, "CHART_PERIOD", 0.0)
    model, q = models.dynamics("two_link").model, np.array([0.1, 0.2])
    actors = [DrawnArm(server, model, name) for name in ("left", "right")]
    news = [(t, q, Sample(t * np.ones(2), np.zeros(2), np.zeros(5))) for t in (100.0, 100.5, 7.0)]
    left, right = Mock(**{"newest.side_effect": news}), Mock(**{"newest.return_value": None})
    page = live.Follower(server, actors, [left, right], Mock(**{"until.return_value": True}))
    page._update(0.1)
    page._update(0.1)
    curves = page._charts._panel.charts
    torque = curves["left: torque [N m]"]
    np.testing.assert_array_equal(torque.time, [0.0, 0.5])
    np.testing.assert_array_equal(torque.values, [[100.0, 100.0], [100.5, 100.5]])
    assert not len(curves["right: torque [N m]"].time)
    assert page._status.content == "left: t = 0.50 s\n\nright: t = 0.00 s, no data yet"
    shown = [frame.position for frame in actors[0]._joints.values()]
    np.testing.assert_array_equal(shown, actors[0].marker.at(Instant(q)).position)
    page._update(0.1)
    np.testing.assert_array_equal(torque.time, [0.0])
    monkeypatch.setattr(live, "SILENCE", -1.0)
    page._report("no luck")
    assert page._status.content.startswith("left: t = 0.00 s, silent for 0 s")
    assert page._status.content.endswith("\n\n**no luck**")


@ros
def test_a_description_of_another_robot_is_named() -> None:
    listener: Any = Deaf()
    arm = live.RunningArm(listener, "")
    listener.heard["/joint_states"](serialize_message(JointState(name=["wrist"])))
    with pytest.raises(ViewError, match="no robot description on /robot_description for"):
        arm.connect(None)
    listener.heard["/robot_description"](SimpleNamespace(data=TWO_LINK.read_text()))
    with pytest.raises(ViewError, match="none of its joints shoulder, elbow, but wrist"):
        arm.connect(None)


@ros
def test_a_missing_node_to_follow_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_WAIT", 0.2)
    with Listener() as listener:
        with pytest.raises(ViewError, match=r"no joint states on /left/joint_states \(waited"):
            live.follower_page(listener, ["left"], [], *HERE)
        with pytest.raises(ViewError, match="2 scenes for 1 running arms"):
            live.follower_page(listener, ["left"], ["a", "b"], *HERE)
