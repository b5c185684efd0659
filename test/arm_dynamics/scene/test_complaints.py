# SPDX-License-Identifier: Apache-2.0
"""Errors in scenes name the file, the key, what is expected, and the likely intention."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

import models
from arm_dynamics import ModelError, SceneError, load_scene
from arm_dynamics.exceptions import did_you_mean
from arm_dynamics.scene.lines import line_of

PLAIN = models.scene("two_link").model_dump(exclude_unset=True)

SAID = {
    "number for a part": (
        {"joints": {"elbow": {"friction": 0.5}}},
        "'joints.elbow.friction' = 0.5: a mapping with some of viscous, coulomb, .* is expected",
    ),
    "name for a list": (
        {"robot": {**PLAIN["robot"], "lock": "elbow"}},
        r"'robot.lock' = 'elbow': a list is expected, such as \[elbow\]",
    ),
    "text for a list": ({"gravity": "[0,0 -9.81]"}, r"such as \[0, 0, -9.81\]$"),
    "number for a name": (
        {"robot": {**PLAIN["robot"], "lock": [1]}},
        "'robot.lock.0' = 1: text is expected; in quotes it is text",
    ),
    "text for truth": (
        {"joints": {"elbow": {"limits": {"stop": "yes"}}}},
        "'joints.elbow.limits.stop' = 'yes': true or false is expected\n"
        "scene: 'joints.elbow.limits.stop' = 'yes': a mapping with some of restitution, .*",
    ),
    "keys of one of two kinds": (
        {"joints": {"elbow": {"limits": {"stop": {"damping": 2}}}}},
        "^scene: 'joints.elbow.limits.stop' = {'damping': 2}: damping belongs to a compliant .*$",
    ),
    "nothing": ({"robot": {}}, "'robot.urdf' is missing; it is required"),
    "frame": (
        {"payloads": [{"frame": "forarm", "mass": 1}]},
        r"'forarm' does not exist; allowed: .*; did you mean 'forearm'\?",
    ),
    "foreign": (
        {"joints": {"*": {"damping": 1}}},
        r"unknown key 'joints.\*.damping' = 1; .*; did you mean 'friction.viscous'\?",
    ),
    "word": ({"tunable": ["gravty"]}, r"'tunable.0' = 'gravty': .*; did you mean 'gravity'\?"),
    "word twice": (
        {"tunable": ["gravity", "external", "gravity"]},
        r"'tunable' = \['gravity', .*\]: 'gravity' is given twice; once is expected",
    ),
    "type": (
        {"constraints": [{"type": "contct"}]},
        r"unknown type 'contct'; allowed: point, .*; did you mean 'contact'\?",
    ),
    "no type": ({"constraints": [{}]}, "'type' is missing"),
}


@pytest.mark.parametrize("case", SAID)
def test_what_is_said(case: str) -> None:
    changes, said = SAID[case]
    with pytest.raises(SceneError, match=said) as caught:
        load_scene({**PLAIN, **changes})
    for leak in ("valid tuple", "valid dict", "instance of", "function-", "Input should be a v"):
        assert leak not in str(caught.value)


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
