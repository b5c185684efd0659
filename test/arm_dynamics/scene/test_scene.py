# SPDX-License-Identifier: Apache-2.0
"""Forms of a scene, and their meaning."""

from pathlib import Path
from typing import Any

import pytest

import models
from arm_dynamics import SceneError, load_scene
from arm_dynamics.scene.imperfections import values
from arm_dynamics.scene.schema import Joint

URDF = models.FOLDER / "planar_3r.urdf"


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.yaml"
    path.write_text(text)
    return path


def test_every_ready_scene_is_among_the_tested_robots() -> None:
    tested = (
        *models.ROBOTS,
        *models.DRIVEN, *models.HELD, *models.BOTH, *models.TOUCHING, *models.BALANCED,
        *models.ARMS, *models.REAL_DRIVES,
    )  # fmt: skip
    assert {path.stem for path in models.SCENES.glob("*.yaml")} <= set(tested)


def test_a_urdf_is_a_scene_in_every_form() -> None:
    text = URDF.read_text()
    forms = [URDF, str(URDF), text, {"robot": {"urdf": str(URDF)}}, {"robot": {"urdf": text}}]
    assert all(load_scene(form) == load_scene(URDF) for form in forms)
    with pytest.raises(SceneError, match="3 is of type int; a path, URDF text or a dictionary"):
        load_scene(3)


@pytest.mark.parametrize(
    ("variable", "packages"), [("ROS_PACKAGE_PATH", "."), ("AMENT_PREFIX_PATH", "share")]
)
def test_packages_are_found_by_the_paths_of_ros(
    variable: str, packages: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / packages / "my_arm/urdf"
    folder.mkdir(parents=True)
    (folder / "arm.urdf").write_text(URDF.read_text())
    monkeypatch.setenv(variable, str(tmp_path))
    assert load_scene("package://my_arm/urdf/arm.urdf") == load_scene(URDF)


def joint1(common: dict[str, Any], own: dict[str, Any]) -> Joint:
    joints = {"*": common, "joint1": own}
    return load_scene({"robot": {"urdf": str(URDF)}, "joints": joints}).joint("joint1")


def test_only_what_is_said_of_a_joint_takes_the_place_of_what_is_said_of_all() -> None:
    """Not the defaults of keys that are not there, and not a key without a value."""
    geared = {"gear_ratio": 50.0, "rotor_inertia": 1e-4}
    actuator = joint1({"actuator": geared}, {"actuator": {"rotor_inertia": 2e-4}}).actuator
    assert actuator is not None
    assert (actuator.gear_ratio, actuator.rotor_inertia) == (50.0, 2e-4)
    empty = {"armature": None, "limits": {"effort": None}}
    found = joint1({"armature": 0.5, "limits": {"effort": 3.0}}, empty)
    assert (found.armature, found.limits.effort) == (0.5, 3.0)


def test_what_says_the_same_in_two_ways_is_replaced_as_a_whole() -> None:
    """Of a table nothing is left that belongs to other points; what stands beside it stays."""
    points = {"speed": [0, 1], "torque": [0.5, 0.2]}
    bends = {"deflection": [0, 1], "torque": [0, 2]}
    several = {"speed": [0, 2], "torque": [[1, 1], [2, 2]], "position": [0, 1], "period": 7}
    dry = {"coulomb": 1.0, "stribeck_velocity": 0.1, "position": {"at": [0, 1], "factor": [1, 2]}}
    sides = {"viscous": {"positive": 1.0, "negative": 2.0}}
    for common, own in (
        ({"friction": {"viscous": 0.5}}, {"friction": sides}),
        ({"friction": sides}, {"friction": {"viscous": 0.5}}),
        ({"friction": {"table": several}}, {"friction": {"table": points}}),
        ({"friction": dry}, {"friction": {"table": points}}),
        ({"friction": {"table": points}}, {"friction": dry}),
        ({"friction": {"position": dry["position"] | {"period": 7}}}, {"friction": dry}),
        ({"spring": {"stiffness": 5.0}}, {"spring": {"table": bends}}),
        ({"spring": {"table": bends}}, {"spring": {"stiffness": 0.0}}),
    ):
        assert joint1(common, own) == joint1({}, own)
    found = joint1({"friction": {"viscous": 2.0} | dry}, {"friction": {"table": points}}).friction
    assert (found.viscous, found.coulomb) == (2.0, None)


def test_numbers_in_yaml_that_yaml_takes_for_text(tmp_path: Path) -> None:
    """YAML 1.1 reads 1e-3 as a string; people write it as a number."""
    path = written(
        tmp_path,
        f"robot: {{urdf: {URDF}}}\njoints: {{joint1: {{armature: 1e-3}}}}\nsim: {{dt: 2e-3}}",
    )
    scene = load_scene(path)
    assert (scene.joint("joint1").armature, scene.sim.dt) == (1e-3, 2e-3)


PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
JOINTS = ("shoulder", "elbow")
SLIDING = models.scene("slider_crank").model_dump(exclude_unset=True)


def test_one_number_is_for_all_joints_and_names_go_before() -> None:
    given = {"noise": 1e-3, "offset": {"*": 1, "elbow": -2}, "resolution": {"shoulder": "1e-4"}}
    position = load_scene({**PLAIN, "sensors": {"position": given}}).sensors.position
    assert values(position.noise, JOINTS) == [1e-3, 1e-3]
    assert values(position.offset, JOINTS) == [1.0, -2.0]
    assert values(position.resolution, JOINTS) == [1e-4, 0.0]


def test_an_encoder_has_one_kind_of_step() -> None:
    position = {"position": {"resolution": 1e-3, "counts": 10}}
    with pytest.raises(SceneError, match=r"'\*' has resolution and counts; one of them is exp"):
        load_scene({**PLAIN, "sensors": position})


def test_a_sliding_joint_has_no_counts_in_a_turn() -> None:
    with pytest.raises(SceneError, match="is prismatic, so it has no counts per revolution"):
        load_scene({**SLIDING, "sensors": {"position": {"counts": 4096}}})
