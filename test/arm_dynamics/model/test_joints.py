# SPDX-License-Identifier: Apache-2.0
"""What joints add to the equations of motion: friction, armature, and followers."""

from typing import Any

import numpy as np

import models
from arm_dynamics import Dynamics
from tolerances import CLOSED_FORM, PINOCCHIO, assert_close

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


RACK = """<robot name="rack">
  <link name="base"/>
  <joint name="lead" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="100" velocity="1"/>
    <dynamics damping="2" friction="0.5"/></joint>
  <joint name="follow" type="prismatic"><parent link="base"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-9" upper="9" effort="100" velocity="1"/><dynamics damping="3" friction="0.7"/>
    <mimic joint="lead" multiplier="-4" offset="0.25"/></joint>
  <link name="a"><inertial><mass value="1.5"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="b"><inertial><mass value="0.6"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
</robot>"""


def test_rack_by_hand() -> None:
    """Speed ratio r = -4: mass m1 + r² m2, weight (m1 + r m2) g, damping d1 + r² d2, dry friction
    c1 + |r| c2.
    """
    dyn = Dynamics(RACK)
    assert dyn.joint_names == ("lead",)
    assert_close(dyn.mass_matrix([0.1]), [[1.5 + 16 * 0.6]], CLOSED_FORM)
    assert_close(dyn.gravity([0.1]), [9.81 * (1.5 - 4 * 0.6)], CLOSED_FORM)
    assert_close(dyn.friction([0.3]), [0.3 * (2 + 16 * 3) + 0.5 + 4 * 0.7], CLOSED_FORM)
    assert_close(dyn.friction([-0.3]), [-0.3 * (2 + 16 * 3) - 0.5 - 4 * 0.7], CLOSED_FORM)


def test_potential_energy_holds_the_offset() -> None:
    dyn = Dynamics(RACK)
    potential = [dyn.energy([q], [0.0])[1] for q in (0.0, 0.2)]
    assert_close(potential[1] - potential[0], 9.81 * 0.2 * (1.5 - 4 * 0.6), CLOSED_FORM)


def test_armature_of_a_follower_acts_through_the_leader() -> None:
    scene = {
        "robot": {"urdf": RACK},
        "joints": {"lead": {"armature": 0.2}, "follow": {"armature": 0.1}},
    }
    gain = Dynamics(scene).mass_matrix([0.0]) - Dynamics(RACK).mass_matrix([0.0])
    assert_close(gain, [[0.2 + 16 * 0.1]], CLOSED_FORM)
