# SPDX-License-Identifier: Apache-2.0
"""The command line without ROS: help, vectors, describe, and what the demo decides by itself."""

import json
import os
import re
import subprocess
import sys
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner, Result
from pictures import unseen, written

import models
from arm_dynamics import Dynamics, InvalidInput, load_scene
from arm_dynamics.scene import Initial
from arm_sim import Recording, Simulator
from arm_sim.cli.call.answers import readable
from arm_sim.cli.demo.motion import choose_motion
from arm_sim.cli.vectors import Vector, parse
from arm_studies.cli.main import main

PANDA = str(models.SCENES / "panda.yaml")


def run(*words: str) -> Result:
    return CliRunner().invoke(main, words)


def test_help_lists_commands_by_subject_in_whole_sentences() -> None:
    said = run("--help").output.split("\n", 1)[1]
    listed = re.findall(r"^  (\w\S*)  +[A-Z]", said, re.M)
    assert sorted(listed) == sorted(main.commands)
    assert re.search(r"\nA running arm:\n  go  +Move the arm", said) and "..." not in said


def test_a_panda_is_described_in_one_screen() -> None:
    said = run("describe", PANDA).output
    assert len(said.splitlines()) <= 40
    for words in (r"2\.175 +87 +0\.003", "computed +gravity", "skipped .*payloads"):
        assert re.search(words, said), words
    details = " ".join(run("describe", "real_panda", "--details").output.split())
    assert "skipped springs none" in details and "Friction: Gaz, Cognetti, Oliva" in details


def test_an_output_without_some_characters_gets_question_marks() -> None:
    """As in a terminal of another encoding, or by PYTHONIOENCODING."""
    found = CliRunner(charset="ascii").invoke(main, ["describe", "two_link"])
    assert found.exit_code == 0 and "m/s?" in found.output


def test_a_full_disk_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with suppress(OSError), Path("/dev/full").open("w") as full:  # closing it fails, too
        with redirect_stdout(full), pytest.raises(SystemExit):
            main(["urdf", "two_link"])
    assert capsys.readouterr().err == "error: the output: No space left on device\n"


def test_files_of_the_suite_are_read_in_an_ascii_locale(
    tmp_path: Path, hasty: dict[str, str]
) -> None:
    """With all code written and compiled anew, from headers with Greek letters in them."""
    odd = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(
        [sys.executable, "-m", "arm_sim.cli", "describe", "pendulum"],
        env=os.environ | odd | hasty | {"XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_description_for_scripts() -> None:
    found = json.loads(run("describe", PANDA, "--json").output)
    sim = Simulator(PANDA)
    assert [joint["name"] for joint in found["joints"]] == list(sim.joint_names)
    assert [joint["effort_limit"] for joint in found["joints"]] == sim.model.effort_limit.tolist()
    assert (found["integrator"], found["dt"]) == ("rk4", sim.dt)
    assert found["skipped"].keys().isdisjoint(found["computed"])
    assert found["computed"]["rigid body"] == "7 joints"


def test_names_are_shown_as_they_are(tmp_path: Path) -> None:
    """Square brackets and backslashes mean something to the library that prints."""
    body = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'/></inertial>"
    (tmp_path / "odd.urdf").write_text(
        f"<robot name='[/z] \\'><link name='[b]'/><link name='[/l]'>{body}</link>"
        "<joint name='[/j]' type='revolute'><parent link='[b]'/><child link='[/l]'/>"
        "<limit lower='0' upper='1' velocity='1' effort='1000'/></joint></robot>"
    )
    (tmp_path / "odd.yaml").write_text("robot: {urdf: odd.urdf}\nlinks: {'[/l]': {mass: 2}}\n")
    said = run("describe", str(tmp_path / "odd.yaml")).output
    for name in ("[/z] \\: 1 joint", "the scene: [/l] 2 kg", " [/j] ", "at its stop: [/j]"):
        assert name in said


def test_a_vector_is_in_order_or_by_name() -> None:
    for text in "1 -2 3e-1", "1,-2,0.3", " 1 , -2 ,.3 ", "[1, -2, 3e-1]":
        assert parse(text) == Vector(((1.0, -2.0, 0.3),), {})
    for text in "b=2 a=-1e-3", "b=2,a=-0.001", '{"b": 2, "a": -1e-3}':
        assert parse(text).flat(["a", "b", "c"]) == [-0.001, 2.0, 0.0]


def test_points(tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_text("1, 2\n3, 4\n\n5, 6\n")
    assert parse("[[1, 2], [3, 4]]") == Vector(((1.0, 2.0), (3.0, 4.0)), {}, True)
    assert parse(f"@{file}").flat(["a", "b"]) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert parse("[[1, 2]]").batch


def test_what_is_no_vector_is_refused() -> None:
    for text in (
        "", " ", "[]", "[[]]", "{}", "a", "1 b", "a=", "=1", "a=b", "a=1 b=2 a=3", "{a: 1, a: 2}",
        "[1, [2]]", "[[1], [2, 3]]", "[true]", "{a", "1 2\n3",
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"number|joint|JSON|list"):
            parse(text)


def test_an_arm_without_mass_is_described(tmp_path: Path) -> None:
    text = (models.FOLDER / "planar_3r.urdf").read_text()
    weightless = re.sub("<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    (tmp_path / "arm.urdf").write_text(weightless)
    said = run("describe", str(tmp_path / "arm.urdf"))
    assert said.exit_code == 0 and re.search("joint3 +revolute +0 +-", said.output)
    assert "not simulated: no link has mass or inertia" in said.output
    told = json.loads(run("describe", str(tmp_path / "arm.urdf"), "--json").output)
    assert "no link has mass" in told["not_simulated"] and "operations" not in told


def test_limits_that_are_placeholders_are_named(tmp_path: Path) -> None:
    text = (models.FOLDER / "planar_3r.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(text.replace('effort="80"', 'effort="1"'))
    told = json.loads(run("describe", str(tmp_path / "arm.urdf"), "--json").output)
    assert list(told["placeholders"]) == ["joint1"]
    assert "placeholders: joint1 (effort 1)" in run("describe", str(tmp_path / "arm.urdf")).output
    (tmp_path / "arm.yaml").write_text(
        "robot: {urdf: arm.urdf}\njoints: {joint1: {limits: {effort: 1}}}"
    )
    assert "placeholder" not in run("describe", str(tmp_path / "arm.yaml")).output


def test_demo_motion_suits_every_robot(robot: str) -> None:
    duration = 2.0 if robot == "panda" else 10.0
    motion = choose_motion(models.scene(robot), duration)
    dynamics = models.dynamics(robot)
    model, path = dynamics.model, motion.trajectory
    assert path.duration == pytest.approx(duration)
    points = [path.sample(t) for t in np.linspace(0.0, duration, 400)]
    q, v, a = (np.array([getattr(point, name) for point in points]) for name in "qva")
    assert np.all((q >= model.position_lower - 1e-9) & (q <= model.position_upper + 1e-9))
    speed = (np.abs(v) / model.velocity_limit).max()
    effort = (np.abs(dynamics.inverse(q, v, a)) / model.effort_limit).max()
    assert motion.effort_share == pytest.approx(effort, rel=0.01)
    assert speed <= 0.71 and effort <= 0.81
    assert np.ptp(q, axis=0).max() > 0.01
    np.testing.assert_allclose(q[-1], q[0], atol=1e-9)


def test_demo_motion_keeps_away_from_joint_limits() -> None:
    """By a twentieth of each joint's range, even from a start beside a limit."""
    model = models.dynamics("panda").model
    span = model.position_upper - model.position_lower
    start = model.position_lower + 0.1 * span
    beside = Initial(position=dict(zip(model.joint_names, start, strict=True)))
    motion = choose_motion(models.scene("panda").model_copy(update={"initial": beside}), 10.0)
    share = (np.array([point.q for point in motion.waypoints]) - model.position_lower) / span
    assert share.min() >= 0.05 - 1e-12 and share.max() <= 0.95 + 1e-12


def test_demo_motion_refuses_an_arm_that_cannot_carry_itself() -> None:
    weak = {"robot": {"urdf": str(models.FOLDER / "gantry.urdf")}}
    weak["joints"] = {"*": {"limits": {"effort": 1.0}}}
    for pull in (-9.81, 9.81):
        with pytest.raises(InvalidInput, match="cannot carry its own weight: joint '"):
            choose_motion(load_scene(weak | {"gravity": [0, 0, pull]}), 5.0)


def test_rounding_is_not_printed_as_a_number() -> None:
    np.testing.assert_array_equal(readable(np.array([2.0, -1e-18, 0.0])), [2.0, 0.0, 0.0])
    np.testing.assert_array_equal(readable(np.array([1e-18, 3e-18])), [1e-18, 3e-18])
    np.testing.assert_array_equal(readable(np.array([np.inf, 1e-3])), [np.inf, 1e-3])


@pytest.mark.parametrize(("method", "trusted"), [("euler", False), ("rk4", True)])
def test_commands_that_run_a_motion_say_whether_it_can_be_trusted(
    method: str, trusted: bool, tmp_path: Path
) -> None:
    """Euler's method is wrong at any length of tick."""
    path = tmp_path / "run.mcap"
    Simulator("two_link", method).run(0.2).save(path)
    said = run("replay", str(path), "--check")
    assert said.exit_code == int(not trusted), said.output
    assert ("accurate to " in said.output) is trusted
    assert ("not trustworthy: " in said.output) is not trusted
    facts = run("replay", str(path), "--json")
    assert facts.exit_code == 0 and json.loads(facts.stdout)["trusted"] is trusted


def test_a_replay_says_what_is_equal_and_what_is_not(tmp_path: Path) -> None:
    path, out = tmp_path / "run.mcap", tmp_path / "again.mcap"
    first = Simulator("two_link").run(0.1)
    first.save(path)
    said = run("replay", str(path), "--out", str(out))
    assert said.exit_code == 0 and "100 time steps replayed, every state bit-id" in said.output
    assert Recording.load(out).q.tobytes() == first.q.tobytes()
    told = json.loads(run("replay", str(path), "--json").stdout)
    assert told["equal"] and told["ticks"] == 100 and told["largest"] == 0.0
    other = run("replay", str(path), "--integrator", "euler", "--json")
    told = json.loads(other.stdout)
    assert other.exit_code == 1 and 0.0 < told["largest"] < 0.1 and told["first_difference"]
    exact = run("replay", str(path), "--tolerance", "1e-10")
    assert exact.exit_code == 1 and "first difference: " in exact.output
    assert run("replay", str(path), "--scene", "pendulum").exit_code == 1


def test_a_plot_has_the_joints_and_the_scene_that_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("robot.csv").write_text("time,position.elbow,position.shoulder\n0,0.1,0.2\n0.5,0.3,0.4\n")
    with unseen(), written() as figures:
        first = run("plot", "robot.csv", "--joint", "elbow")
        second = run("plot", "robot.csv", "robot.csv", "--scene", "two_link", "--out", "both.png")
        window = run("plot", "robot.csv", "--show", "--out", "both.png")
    assert first.exit_code == second.exit_code == 0, first.output + second.output
    assert Path("robot.png").exists() and Path("both.png").exists()
    assert "without a scene" in first.output and "without a scene" not in second.output
    one, both, _ = (figure.axes[0].lines for figure in figures)
    assert [line.get_label() for line in one if line.get_marker() == "None"] == ["elbow"]
    drawn = [x.get_linestyle() for x in both if x.get_marker() == "None" and len(x.get_xdata())]
    assert drawn == ["-", "--", "-", "--"]
    assert window.exit_code == 1 and "no window: Matplotlib has no display" in window.output


def test_hardware_is_added_to_a_description(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lib.so").touch()

    def hardware(*words: str) -> tuple[str, dict[str, str], list[str]]:
        told = run("urdf", "two_link", "--ros2-control", *words)
        assert told.exit_code == 0, told.output
        tag: Any = ElementTree.fromstring(told.stdout).find("ros2_control")
        parameters = {str(p.get("name")): str(p.text) for p in tag.iterfind("hardware/param")}
        commands = [str(c.get("name")) for c in tag.iterfind("joint/command_interface")]
        starts = tag.iterfind("joint/state_interface[@name='position']/param")
        assert [float(p.text) for p in starts] == Dynamics("two_link").model.q0.tolist()
        return str(tag.findtext("hardware/plugin")), parameters, commands

    plugin, parameters, commands = hardware("effort", "--library", "lib.so")
    assert "arm_ros2_control" in plugin and commands == ["effort", "effort"]
    assert parameters == {"library": str(tmp_path / "lib.so")}  # wherever it is started
    _, parameters, commands = hardware("position", "--commands-topic", "/left/commands")
    assert commands == ["position", "position"]
    assert parameters["joint_commands_topic"] == "/left/commands"
    assert "<ros2_control" not in run("urdf", "two_link").stdout
