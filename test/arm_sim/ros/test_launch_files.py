# SPDX-License-Identifier: Apache-2.0
"""Launch files use existing executables and parameters; all of them are installed."""

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from launch_files import Launch, Start, by_python

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.ros.common.params import listed
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_sim.cli.urdf import TOPICS, with_hardware
from arm_sim.ros.sim_params import SimParams

PACKAGE = Path(__file__).parents[3] / "src/arm_sim"
FILES = sorted((PACKAGE / "launch").glob("*.launch.xml"))
OURS = {"sim": SimParams, "controller": ControllerParams}
OTHERS = {  # packages of ROS 2 Jazzy, with the executables that are started
    ("robot_state_publisher", "robot_state_publisher"), ("rviz2", "rviz2"),
    ("controller_manager", "ros2_control_node"), ("controller_manager", "spawner"),
}  # fmt: skip
FOREIGN = {"robot_state_publisher": {"robot_description"}}


def started(name: str, **given: str) -> list[Start]:
    share = {"arm_sim": PACKAGE}
    return Launch(share, by_python).read(PACKAGE / f"launch/{name}.launch.xml", given)


@pytest.mark.parametrize("file", FILES, ids=lambda path: path.name)
def test_what_is_started_exists(file: Path) -> None:
    for start in started(file.name.split(".")[0]):
        if start.package in ("arm_sim", "arm_dynamics"):
            setup = (PACKAGE.parent / start.package / "setup.py").read_text()
            assert f'"{start.executable} = {start.package}.' in setup
            known = {name for name, *_ in listed(OURS[start.executable])}
            assert start.name == start.executable
        else:
            assert (start.package, start.executable) in OTHERS
            known = FOREIGN.get(start.executable, set())
        assert set(start.parameters) <= known
        assert all(path.is_file() for path in start.files)


def test_parameters_of_the_file_are_the_defaults() -> None:
    given = yaml.safe_load((PACKAGE / "config/parameters.yaml").read_text())
    assert set(given) == {"/**/sim", "/**/controller"}
    for node, params in OURS.items():
        default = {name: value for name, value, _ in listed(params)}
        for name, value in given[f"/**/{node}"]["ros__parameters"].items():
            np.testing.assert_array_equal(np.ravel(value), np.ravel(default[name]))


def test_arguments_reach_the_nodes() -> None:
    one = {start.executable: start for start in started("arm", scene="ur5e", controller="float")}
    assert one["sim"].parameters["scene"] == one["controller"].parameters["scene"] == "ur5e"
    assert one["controller"].parameters["controller"] == "float"
    both = started("two_arms", right="ur5e")
    assert [(s.namespace, s.executable, s.parameters["scene"]) for s in both] == [
        ("/left", "sim", "panda"), ("/left", "controller", "panda"),
        ("/right", "sim", "ur5e"), ("/right", "controller", "ur5e"),
    ]  # fmt: skip
    assert [s.parameters["frame_prefix"] for s in both if s.executable == "sim"] == [
        "left/", "right/",
    ]  # fmt: skip


def test_a_display_shows_the_description_of_the_scene() -> None:
    found = {start.executable: start for start in started("display", scene="two_link")}
    description = found["robot_state_publisher"].parameters["robot_description"]
    assert str(description).strip() == models.scene("two_link").robot.urdf.strip()
    assert found["robot_state_publisher"].remaps["joint_states"] == "sim/all_joint_states"
    option, file, *frame = found["rviz2"].words
    assert option == "-d" and Path(file).is_file() and frame == ["-f", "panda_link0"]
    assert "rviz2" not in {start.executable for start in started("display", rviz="false")}
    shown = yaml.safe_load((PACKAGE / "rviz/arm.rviz").read_text())["Visualization Manager"]
    arm = next(d for d in shown["Displays"] if d["Class"] == "rviz_default_plugins/RobotModel")
    assert arm["Description Topic"]["Value"] == "robot_description"
    assert arm["Description Topic"]["Durability Policy"] == "Transient Local"


def test_hardware_of_ros2_control_works_with_the_sim() -> None:
    found = {start.executable: start for start in started("ros2_control", command="effort")}
    text = str(found["robot_state_publisher"].parameters["robot_description"])
    tag = ElementTree.fromstring(text).find("ros2_control")
    assert tag is not None and tag.findtext("hardware/plugin") == TOPICS
    said = {p.get("name"): p.text for p in tag.findall("hardware/param")}
    remaps = found["sim"].remaps
    assert said["joint_commands_topic"] == "/" + remaps["joint_commands"]
    assert said["joint_states_topic"] == "/" + remaps["joint_states"]
    assert float(said["trigger_joint_command_threshold"] or 0) < 0.0
    joints = [joint.get("name") for joint in tag.findall("joint")]
    assert joints == list(models.dynamics("panda").joint_names)
    assert {c.get("name") for c in tag.iter("command_interface")} == {"effort"}
    listed = yaml.safe_load(found["ros2_control_node"].files[0].read_text())
    assert listed["joint_trajectory_controller"]["ros__parameters"]["joints"] == joints
    manager = listed["controller_manager"]["ros__parameters"]
    assert set(found["spawner"].words) & set(manager) == set(manager) - {"update_rate"}


def test_a_description_keeps_its_robot() -> None:
    """With the tag it is the same arm; that of other hardware (the xArm has one) is taken out."""
    model = models.dynamics("xarm7").model
    text = with_hardware(model, "position", TOPICS, {"joint_states_topic": "/states"})
    assert len(re.findall("<ros2_control", text)) == 1
    again = Dynamics(load_scene({"robot": {"urdf": text}}))
    q = np.full(model.n, 0.3)
    np.testing.assert_array_equal(again.gravity(q), models.dynamics("xarm7").gravity(q))


def test_what_is_shared_is_installed(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "setup.py", "-q", "install_data", "--install-dir", tmp_path],
        cwd=PACKAGE, check=True, timeout=60,
    )  # fmt: skip
    installed = tmp_path / "share/arm_sim"
    for folder in ("config", "launch", "rviz"):
        there = {path.name for path in (installed / folder).iterdir()}
        assert there == {path.name for path in (PACKAGE / folder).iterdir()}
    of_scenes = {
        path.relative_to(installed / "scenes") for path in installed.rglob("scenes/**/*.*")
    }
    assert of_scenes == {
        path.relative_to(models.SCENES)
        for path in models.SCENES.rglob("*")
        if path.suffix in (".yaml", ".urdf")
    }
