# SPDX-License-Identifier: Apache-2.0
"""What a scene may look like, and what it means."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, Scene, load_scene

URDF = models.FOLDER / "planar_3r.urdf"


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", models.ROBOTS)
def test_every_scene_loads(name: str) -> None:
    assert isinstance(models.scene(name), Scene)


@pytest.mark.parametrize("path", sorted(models.SCENES.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_ready_scene_is_among_the_tested_robots(path: Path) -> None:
    assert path.stem in (*models.ROBOTS, *models.DRIVEN, *models.HELD, *models.TOUCHING)


def test_a_urdf_is_a_scene_in_every_form() -> None:
    text = URDF.read_text()
    forms = [URDF, str(URDF), text, {"robot": {"urdf": str(URDF)}}, {"robot": {"urdf": text}}]
    assert all(load_scene(form) == load_scene(URDF) for form in forms)


def test_a_scene_is_returned_as_it_is() -> None:
    scene = models.scene("planar_3r")
    assert load_scene(scene) is scene


def test_defaults() -> None:
    scene = load_scene(URDF)
    assert tuple(scene.gravity) == (0.0, 0.0, -9.81)
    assert (scene.robot.lock, scene.payloads, scene.joints) == ((), (), {})


def test_urdf_is_found_beside_the_scene_file(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF.read_text())
    scene = load_scene(written(tmp_path, "robot: {urdf: arm.urdf}"))
    assert scene.robot.urdf == URDF.read_text()


def test_package_uri_by_ros_package_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_arm/urdf").mkdir(parents=True)
    (tmp_path / "my_arm/urdf/arm.urdf").write_text(URDF.read_text())
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    assert load_scene("package://my_arm/urdf/arm.urdf") == load_scene(URDF)


def test_package_uri_by_ament_prefix_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "share/my_arm/urdf"
    folder.mkdir(parents=True)
    (folder / "arm.urdf").write_text(URDF.read_text())
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert load_scene("package://my_arm/urdf/arm.urdf") == load_scene(URDF)


def test_missing_mesh_is_no_error() -> None:
    """Dynamics reads no mesh, so a description without its meshes is complete."""
    seen = (
        '<link name="link3"><visual><geometry><mesh filename="package://gone/hand.dae"/></geometry></visual>'
        '<collision><geometry><mesh filename="nowhere.stl"/></geometry></collision>'
    )
    text = URDF.read_text().replace('<link name="link3">', seen)
    still = np.zeros(3)
    np.testing.assert_array_equal(
        Dynamics(text).gravity(still), models.dynamics("planar_3r").gravity(still)
    )


def test_star_speaks_for_all_joints_and_gives_way_to_a_name() -> None:
    scene = load_scene({
        "robot": {"urdf": str(URDF)},
        "joints": {
            "*": {"friction": {"viscous": 0.5, "coulomb": 0.1}, "armature": 0.2},
            "joint2": {"friction": {"viscous": 9.0}},
        },
    })  # fmt: skip
    model = Dynamics(scene).model
    np.testing.assert_array_equal(model.viscous, [0.5, 9.0, 0.5])
    np.testing.assert_array_equal(model.friction.coulomb.mean, [0.1, 0.1, 0.1])
    np.testing.assert_array_equal(model.armature, [0.2, 0.2, 0.2])


def test_numbers_in_yaml_that_yaml_takes_for_text(tmp_path: Path) -> None:
    """YAML 1.1 reads 1e-3 as a string; people write it as a number."""
    path = written(
        tmp_path,
        f"robot: {{urdf: {URDF}}}\njoints: {{joint1: {{armature: 1e-3}}}}\nsim: {{dt: 2e-3}}",
    )
    scene = load_scene(path)
    assert (scene.joint("joint1").armature, scene.sim.dt) == (1e-3, 2e-3)


def test_a_scene_cannot_be_changed() -> None:
    scene = models.scene("planar_3r")
    with pytest.raises(ValueError, match="frozen"):
        scene.gravity = (0.0, 0.0, 0.0)  # type: ignore[misc]


def test_gravity_of_the_scene_is_used(rng: np.random.Generator) -> None:
    """Gravity is linear: that of a sum is the sum, and none is none."""
    q = rng.uniform(-3, 3, 4)
    text = (models.FOLDER / "skew_axes.urdf").read_text()

    def torque(*gravity: float) -> np.ndarray:
        return Dynamics({"robot": {"urdf": text}, "gravity": gravity}).gravity(q)

    np.testing.assert_array_equal(torque(0, 0, 0), np.zeros(4))
    parts = torque(1, 0, 0) + torque(0, 2, 0) + torque(0, 0, -3)
    np.testing.assert_allclose(torque(1, 2, -3), parts, rtol=0, atol=1e-12)


def test_initial_state_by_name() -> None:
    model = Dynamics({
        "robot": {"urdf": str(URDF)},
        "initial": {"position": {"joint3": 0.4}, "velocity": {"joint1": -1.0}},
    }).model  # fmt: skip
    np.testing.assert_array_equal(model.q0, [0.0, 0.0, 0.4])
    np.testing.assert_array_equal(model.v0, [-1.0, 0.0, 0.0])
