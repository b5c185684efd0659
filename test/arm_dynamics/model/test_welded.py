# SPDX-License-Identifier: Apache-2.0
"""Locked joints and payloads: the same as if they were welded on."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, load_scene
from models.oracle import Oracle
from tolerances import PINOCCHIO, assert_close

CASES: dict[str, tuple[str, list[str], dict[str, float]]] = {
    "elsewhere": ("spherical_wrist", ["elbow", "wrist_2"], {"elbow": 0.9, "wrist_2": -0.4}),
    "a slide": ("scara", ["slide"], {"slide": 0.13}),
    "a branch": ("two_arms", ["left_shoulder", "left_elbow"], {"left_elbow": -1.0}),
    "a leader and so its followers": ("gripper", ["left_slide"], {"left_slide": 0.03}),
    "a chain of followers": ("finger", ["knuckle"], {"knuckle": 0.5}),
}


def locked(name: str, joints: list[str], position: dict[str, float]) -> Any:
    urdf = str(models.FOLDER / f"{name}.urdf")
    return load_scene({"robot": {"urdf": urdf, "lock": joints}, "initial": {"position": position}})


@pytest.mark.parametrize(("name", "joints", "position"), CASES.values(), ids=CASES)
def test_equals_the_full_robot_held_still(
    name: str, joints: list[str], position: dict[str, float], rng: np.random.Generator
) -> None:
    scene = locked(name, joints, position)
    dyn, oracle = Dynamics(scene), Oracle(scene)
    assert list(dyn.joint_names) == oracle.joint_names
    for _ in range(5):
        q, v, a = models.random_state(rng, dyn.n)
        assert_close(dyn.inverse(q, v, a), oracle.inverse(q, v, a), PINOCCHIO)
        assert_close(dyn.mass_matrix(q), oracle.mass_matrix(q), PINOCCHIO)
        assert_close(dyn.gravity(q), oracle.gravity(q), PINOCCHIO)


def test_friction_of_a_locked_joint_is_gone() -> None:
    dyn = Dynamics(locked("planar_3r", ["joint2"], {}))
    np.testing.assert_allclose(dyn.friction([1.0, -2.0]), [0.7 + 0.3, -0.2 - 0.05], rtol=1e-14)


URDF = models.FOLDER / "skew_axes.urdf"
WELD = """<link name="load"><inertial><origin xyz="0.03 -0.02 0.05"/><mass value="1.7"/>
<inertia ixx="0.02" ixy="0.001" ixz="-0.002" iyy="0.03" iyz="0.0005" izz="0.025"/></inertial>
</link><joint name="load_weld" type="fixed"><parent link="{frame}"/><child link="load"/></joint>
</robot>"""
LOAD = {
    "mass": 1.7,
    "com": [0.03, -0.02, 0.05],
    "inertia": [0.02, 0.001, -0.002, 0.03, 0.0005, 0.025],
}


@pytest.mark.parametrize("frame", ["d", "adapter"])
def test_equals_the_mass_in_the_urdf(frame: str, rng: np.random.Generator) -> None:
    welded = Dynamics(URDF.read_text().replace("</robot>", WELD.format(frame=frame)))
    dyn = Dynamics({"robot": {"urdf": str(URDF)}, "payloads": [{"frame": frame, **LOAD}]})
    for _ in range(5):
        q, v, a = models.random_state(rng, dyn.n)
        assert_close(dyn.inverse(q, v, a), welded.inverse(q, v, a), PINOCCHIO)
        assert_close(dyn.mass_matrix(q), welded.mass_matrix(q), PINOCCHIO)
        assert_close(dyn.energy(q, v)[0], welded.energy(q, v)[0], PINOCCHIO)


def test_beyond_a_locked_joint(rng: np.random.Generator) -> None:
    scene = load_scene({
        "robot": {"urdf": str(URDF), "lock": ["fourth"]},
        "initial": {"position": {"fourth": 0.7}},
        "payloads": [{"frame": "d", **LOAD}],
    })  # fmt: skip
    dyn, oracle = Dynamics(scene), Oracle(scene)
    for _ in range(20):
        q, v, a = models.random_state(rng, dyn.n)
        assert_close(dyn.inverse(q, v, a), oracle.inverse(q, v, a), PINOCCHIO)


def test_a_tensor_that_is_negative_only_by_rounding_counts_as_it_is(
    rng: np.random.Generator,
) -> None:
    """Tensors that were turned or shifted come out so."""
    q, v, a = models.random_state(rng, 4)
    flat = {"mass": 1.0, "com": [0.1, 0.0, 0.0]}
    thin, turned = (
        Dynamics({"robot": {"urdf": str(URDF)},
                  "payloads": [{"frame": "d", **flat, "inertia": [xx, 0, 0, 0.02, 0, 0.02]}]})
        for xx in (0.0, -5e-13)
    )  # fmt: skip
    assert_close(turned.inverse(q, v, a), thin.inverse(q, v, a), PINOCCHIO)
    assert_close(turned.forward(q, v, a), thin.forward(q, v, a), PINOCCHIO)
