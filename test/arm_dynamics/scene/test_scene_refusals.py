# SPDX-License-Identifier: Apache-2.0
"""A bad scene gives one clear error that names the key, the value and what is allowed."""

import re
from pathlib import Path
from typing import Any

import pytest

import models
from arm_dynamics import ArmModel, ModelError, SceneError, load_scene
from arm_dynamics.exceptions import did_you_mean
from arm_dynamics.scene.lines import line_of, parse

URDF = str(models.FOLDER / "planar_3r.urdf")


def payload(**changes: Any) -> dict[str, Any]:
    return {"payloads": [{"frame": "link3", "mass": 1.0, **changes}]}


def sprung(*springs: dict[str, Any]) -> dict[str, Any]:
    return {"springs": [{"frames": ["link3", "world"], **spring} for spring in springs]}


def limited(**limits: Any) -> dict[str, Any]:
    return {"joints": {"*": {"limits": limits}}}


PLANE = {"type": "plane", "frames": ["link3", "world"], "normal": [0, 0, 1e-10]}
STOPS = {
    "*": {"limits": {"stop": {"restitution": 0.5}}},
    "joint1": {"limits": {"lower": -1, "upper": 1, "stop": {"stiffness": 1e4}}},
}
# What stands beside `robot` in the scene, and what the error says.
BAD_KEYS: list[tuple[dict[str, Any], str]] = [
    (sprung({"rest_length": 1}), "springs.0.*stiffness"),
    (sprung({"damping": 1, "tension_only": True}), "springs.0.*tension_only.*taut"),
    (sprung({"stiffness": 1}, {"force": 1, "name": "spring_0"}), "two springs.*spring_0"),
    (limited(lower=0.5, upper=0.5), "joints.*limits.*robot.lock holds a joint where it is"),
    (payload(inertia=[-1.01e-10, 0, 0, 1, 0, 1]), "inertia.*negative in any direction.*-1.01"),
    (payload(inertia=[1, 0, 0, 1, 0, 2.1]), "payloads.0.inertia.*principal moments 1, 1, 2.1"),
    (payload(mass=0, inertia=[1, 0, 0, 1, 0, 1]), "payloads.0.inertia.*mass = 0"),
    ({"constraints": [PLANE]}, "normal.*not be zero"),
    ({"tunable": ["payload"]}, "tunable.*there are no 'payloads'"),
    ({"joints": STOPS}, "joints.joint1.limits.stop.*0.5.*10000"),
    ({"robot": {"urdf": "package://nobody/a.urdf"}}, "package://nobody/a.urdf"),
]

NO_YAML = "this is not well-formed YAML"
ENDLESS = "this YAML cannot be used: nested too deeply, or an alias within its own anchor"
BAD_YAML = {
    "an alias of nothing": ("robot: {urdf: x}\nsim: *no", f"{NO_YAML} in line 2: found undefined"),
    "a list": ("- robot\n- sim\n", "the file holds a list; a mapping with 'robot' is expected"),
    "an object": ("robot: !!python/object/apply:os.getcwd []", f"{NO_YAML} in line 1: could not"),
    "an alias within its anchor": ("robot: &all [*all]", ENDLESS),
    "a list for a key": (
        "robot: {urdf: x}\njoints: {[joint1, joint2]: {armature: 1}}",
        "a key in line 2 is a list or a mapping; a name is expected",
    ),
    "aliases that double forty times": (
        "a0: &a0 [1]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 41)),
        "with its aliases written out, this YAML has 6.6e+12 values; at most 1000000 are expected",
    ),
}


@pytest.mark.parametrize(("part", "words"), BAD_KEYS)
def test_bad_key(part: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        load_scene({"robot": {"urdf": URDF}, **part})


FINE_KEYS: dict[str, dict[str, Any]] = {
    "a lower limit alone": {"joints": {"*": {"limits": {"lower": 5}}}},
    "rounding of an inertia": payload(inertia=[-1e-12, 0, 0, 1, 0, 1]),
    "a thin plate whose numbers have two digits": payload(inertia=[0.33, 0, 0, 0.67, 0, 1.01]),
    "a payload without weight": payload(mass=0),
}


@pytest.mark.parametrize("part", FINE_KEYS.values(), ids=FINE_KEYS)
def test_what_is_just_allowed(part: dict[str, Any]) -> None:
    assert load_scene({"robot": {"urdf": URDF}, **part})


@pytest.mark.parametrize(("text", "said"), BAD_YAML.values(), ids=BAD_YAML)
def test_bad_yaml_names_the_file_and_the_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(SceneError, match=re.escape(f"bad.yaml: scene: {said}")):
        load_scene(path)


@pytest.mark.parametrize("number", ["010", "1:30"])
def test_a_number_that_yaml_reads_as_another_is_refused(number: str, tmp_path: Path) -> None:
    """YAML 1.1 reads these as 8 and 90."""
    path = tmp_path / "bad.yaml"
    path.write_text(f"robot: {{urdf: {URDF}}}\ngravity:\n- 0\n- 0\n- {number}\n")
    with pytest.raises(SceneError, match=f"bad.yaml:5: scene: 'gravity.2' = .*{number}.*decimal"):
        load_scene(path)


def test_a_key_twice_in_an_item_of_a_list_is_named_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(f"robot: {{urdf: {URDF}}}\npayloads: [{{frame: x, mass: 1, mass: 2}}]\n")
    with pytest.raises(SceneError, match="bad.yaml:2: scene: 'payloads.0.mass' is given twice"):
        load_scene(path)


def test_several_mappings_may_be_merged_into_one() -> None:
    text = "a: &a {x: 1}\nb: &b {y: 2}\nc:\n  <<: *a\n  <<: *b\n  z: 3\n"
    assert parse(text)["c"] == {"x": 1, "y": 2, "z": 3}


def test_locking_everything() -> None:
    scene = load_scene({"robot": {"urdf": URDF, "lock": ["joint1", "joint2", "joint3"]}})
    with pytest.raises(SceneError, match="no joint"):
        ArmModel(scene)


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


def test_keys_are_found_in_their_lines() -> None:
    places = {
        "robot.urdf": 1, "joints": 2, "joints.elbow": 3, "joints.elbow.friction.viscous": 5,
        "joints.elbow.spring": 3, "joints.a.b.armature": 7, "payloads.0": 9,
        "payloads.1.frame": 10, "payloads.1.mass": 11, "payloads.1.com": 10, "payloads.5": 8,
        "gravity": None,
    }  # fmt: skip
    assert {place: line_of(LINED, place) for place in places} == places


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


def test_an_angle_in_degrees_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    for angle in (6.0, 90.0):
        assert not caplog.records
        load_scene({"robot": {"urdf": URDF}, "initial": {"position": {"joint2": angle}}})
    assert "'initial.position.joint2' = 90 is 14.3 turns; angles are in rad" in caplog.text
