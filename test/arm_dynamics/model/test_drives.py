# SPDX-License-Identifier: Apache-2.0
"""Friction and armature: where they come from and what they do to the equations of motion."""

from typing import Any

import numpy as np

import models
from arm_dynamics import Dynamics
from tolerances import PINOCCHIO, assert_close

URDF = str(models.FOLDER / "planar_3r.urdf")


def with_joints(**joints: Any) -> Dynamics:
    return Dynamics({"robot": {"urdf": URDF}, "joints": joints})


def test_friction_of_the_urdf_is_honoured() -> None:
    v = np.array([2.0, -3.0, 0.5])
    np.testing.assert_allclose(
        Dynamics(URDF).friction(v), [1.4 + 0.3, -1.2 - 0.2, 0.05 + 0.05], rtol=1e-14
    )


def test_friction_of_the_scene_replaces_what_it_names() -> None:
    """Only the coefficient that is given: joint2 keeps the URDF's dry friction."""
    dyn = with_joints(
        joint1={"friction": {"viscous": 0.0, "coulomb": 0.0}},
        joint2={"friction": {"viscous": 5.0}},
    )
    np.testing.assert_allclose(dyn.friction([1.0, 1.0, 1.0]), [0.0, 5.2, 0.15], rtol=1e-14)


def test_friction_opposes_motion_and_is_odd_but_for_the_puma(
    robot: str, rng: np.random.Generator
) -> None:
    dyn = models.dynamics(robot)
    for v in rng.normal(size=(50, dyn.n)):
        assert v @ dyn.friction(v) >= 0.0
        odd = np.array_equal(dyn.friction(-v), -dyn.friction(v))
        assert odd is not (robot == "puma560")


def test_armature_enters_torque_and_kinetic_energy_only(rng: np.random.Generator) -> None:
    """It stands on the diagonal of M."""
    dyn, bare = with_joints(**{"*": {"armature": 0.4}}), Dynamics(URDF)
    q, v, a = models.random_state(rng, 3)
    assert_close(dyn.mass_matrix(q), bare.mass_matrix(q) + 0.4 * np.eye(3), PINOCCHIO)
    assert_close(dyn.inverse(q, v, a), bare.inverse(q, v, a) + 0.4 * a, PINOCCHIO)
    assert_close(dyn.coriolis_matrix(q, v), bare.coriolis_matrix(q, v), PINOCCHIO)
    assert_close(dyn.gravity(q), bare.gravity(q), PINOCCHIO)
    assert_close(dyn.energy(q, v)[0], bare.energy(q, v)[0] + 0.2 * v @ v, PINOCCHIO)
