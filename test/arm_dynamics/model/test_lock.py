# SPDX-License-Identifier: Apache-2.0
"""A locked joint does not move: the others behave as if it were welded."""

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
