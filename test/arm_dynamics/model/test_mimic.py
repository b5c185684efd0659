# SPDX-License-Identifier: Apache-2.0
"""Followers add their inertia, weight and friction to their leader."""

from arm_dynamics import Dynamics
from tolerances import CLOSED_FORM, assert_close

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
