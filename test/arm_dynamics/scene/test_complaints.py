# SPDX-License-Identifier: Apache-2.0
"""Errors in scenes name the file, the key, what is expected, and the likely intention."""

import logging
from pathlib import Path

import pytest

import models
from arm_dynamics import ModelError, SceneError, load_scene
from arm_dynamics.exceptions import did_you_mean
from arm_dynamics.scene.lines import line_of

PLAIN = models.scene("two_link").model_dump(exclude_unset=True)


def test_every_line_names_the_file_and_the_line(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text("robot: {urdf: x}\ngravty: 1\nsim: 3\n")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    lines = sorted(str(caught.value).splitlines())
    assert lines[0].startswith(f"{path}:2: scene: unknown key 'gravty' = 1; ")
    assert lines[1].startswith(f"{path}:3: scene: 'sim' = 3: a mapping ")
    assert len(lines) == 2


LINED = """\
robot: {urdf: x}
joints:
  elbow:
    friction:
      viscous: 1
  a.b:
    armature: 1
payloads:
- {frame: tip}
- frame: tip
  mass: 1
"""
PLACES = {
    "robot.urdf": 1, "joints": 2, "joints.elbow": 3, "joints.elbow.friction.viscous": 5,
    "joints.elbow.spring": 3, "joints.a.b.armature": 7, "payloads.0": 9, "payloads.1.frame": 10,
    "payloads.1.mass": 11, "payloads.1.com": 10, "payloads.5": 8, "gravity": None,
}  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_keys_are_found_in_their_lines(place: str) -> None:
    assert line_of(LINED, place) == PLACES[place]


def test_what_is_wrong_in_a_description_names_both_files(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text("<robot name='x'><joint name='j' type='floating'/></robot>")
    path = tmp_path / "arm.yaml"
    path.write_text("robot: {urdf: arm.urdf}\n")
    for source, files in ((path, "arm.yaml: .*arm.urdf: "), (tmp_path / "arm.urdf", "arm.urdf: ")):
        with pytest.raises(ModelError, match=files):
            load_scene(source)


def test_names_that_differ_in_numbers_only_are_not_meant() -> None:
    assert did_you_mean("joint9", ["joint1", "joint4"]) == ""
    assert did_you_mean("jont4", ["joint1", "joint4"]) == "; did you mean 'joint4'?"
    assert did_you_mean("something", ["joint1"]) == ""
    assert did_you_mean("panda_arm", ["pen_arm", "panda"]) == "; did you mean 'panda'?"
    assert did_you_mean("damping_ration", ["damping", "damping_ratio"]).endswith(
        "'damping_ratio'?"
    )


def test_an_angle_in_degrees_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        load_scene({**PLAIN, "initial": {"position": {"elbow": 6.0}}})
        assert not caplog.records
        load_scene({**PLAIN, "initial": {"position": {"elbow": 90.0}}})
    assert "'initial.position.elbow' = 90 is 14.3 turns; angles are in rad" in caplog.text
