# SPDX-License-Identifier: Apache-2.0
"""Every number of a robot description that matters is read, or refused by name; none is lost."""

import logging
import re

import numpy as np
import pinocchio as pin
import pytest

from arm_dynamics import ArmModel, ModelError, load_scene
from arm_dynamics.scene.load import SceneSource
from arm_dynamics.scene.urdf.description import read_urdf

URDF = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial>
    <origin xyz="0.2 0.5 -0.01" rpy="0.1 0.2 0.3"/><mass value="3"/>
    <inertia ixx="0.01" ixy="0.001" ixz="-2e-3" iyy="0.04" iyz="0.003" izz="0.041"/>
  </inertial></link>
  <link name="fore"><inertial>
    <mass value="1.5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
  </inertial></link>
  <link name="hand"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0.3 0.1" rpy="0.4 0.5 0.6"/><axis xyz="0.479 -0.64 0.6"/>
    <parent link="base"/><child link="upper"/>
    <limit lower="-3" upper="2.5" effort="80" velocity="4"/>
    <dynamics damping="0.3" friction="0.2"/>
    <calibration rising="0.7"/>
    <safety_controller soft_lower_limit="-2" soft_upper_limit="2" k_position="9" k_velocity="8"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/><limit effort="30" velocity="6"/>
  </joint>
  <joint name="finger" type="prismatic">
    <parent link="fore"/><child link="hand"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="5" velocity="2"/>
    <mimic joint="elbow" multiplier="0.7" offset="-0.1"/>
  </joint>
</robot>"""
NUMBERS = list(re.finditer(r'(\w+)="([-\d. e]+)"', URDF))
UNREAD = ("rising", "soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity")
OPEN = ("lower", "upper", "effort", "velocity")


def arm(source: SceneSource) -> ArmModel:
    return ArmModel(load_scene(source))


def put(found: re.Match[str], text: str) -> str:
    """The description with another text in place of a number."""
    return URDF[: found.start(2)] + text + URDF[found.end(2) :]


def changed(old: str, new: str) -> str:
    assert URDF.count(old) == 1
    return URDF.replace(old, new)


def assert_read(text: str, expected: str = URDF) -> None:
    """Pinocchio and the suite are told the same as by the expected description."""
    urdf, other = read_urdf(text), read_urdf(expected)
    assert (urdf.joints, urdf.links, urdf.mimics) == (other.joints, other.links, other.mimics)
    assert pin.buildModelFromXML(urdf.text) == pin.buildModelFromXML(other.text)


@pytest.mark.parametrize("text", ["1_000", "0x10", "infinity", "nan", "1e400", "${pi/2}", ""])
def test_what_other_readers_take_for_no_number_is_refused_by_name(text: str) -> None:
    for found in NUMBERS:
        key, rest = found[1], " ".join(found[2].split()[1:])
        given = f"{text} {rest}".strip()
        if key in UNREAD:
            assert_read(put(found, given))
        elif key in OPEN and text in ("infinity", "1e400"):
            assert "infinite: there is none" in str(read_urdf(put(found, given)).notes)
        else:
            with pytest.raises(ModelError, match=r"(link|joint) '\w+': <\w+ ") as caught:
                read_urdf(put(found, given))
            assert f"{key}={given!r}>: expected " in str(caught.value)


def test_numbers_of_many_digits_keep_every_bit() -> None:
    rng = np.random.default_rng(1)
    for mass in np.exp(rng.uniform(-300.0, 300.0, 40)).tolist():
        model = arm(changed('mass value="3"', f'mass value="{mass!r}"'))
        assert model.whole.inertias[1].mass == mass


TOLD = [  # of what is changed; what it means, test_ways_of_writing.py asserts
    ('ixy="0.001" ixz="-2e-3" ', "", "link 'upper': <inertia> without ixy, ixz: taken as 0"),
    ("0.479 -0.64 0.6", "0.958 -1.28 1.2", "joint 'shoulder': <axis> is not of length 1"),
    ('<axis xyz="1 0 0"/>', "", "joint 'finger': no <axis>: taken as the default, 1 0 0"),
    (' effort="80"', "", "joint 'shoulder': <limit> without effort: none is assumed"),
    (' name="arm"', "", "the root element: <robot> has no name: 'robot' is used"),
    ("<dynamics", "<dynamic", "joint 'shoulder': <dynamic> has no effect; did you mean <dynam"),
]


@pytest.mark.parametrize(("old", "new", "words"), TOLD)
def test_what_is_missing_is_filled_in_and_told(
    old: str, new: str, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        load_scene(URDF)
        assert not caplog.records
        load_scene(changed(old, new))
    assert f"robot description: {words}" in caplog.text


def test_what_many_joints_lack_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        load_scene(re.sub(r' effort="\d+"', "", URDF))
    assert len(caplog.records) == 1
    assert "without effort: none is assumed (and joint 'elbow', joint" in caplog.text


def test_infinite_limits_are_none() -> None:
    model = arm(changed(
        'lower="-3" upper="2.5" effort="80" velocity="4"',
        'lower="-INFINITY" upper=" +inf " effort="inf" velocity="1e999"',
    ))  # fmt: skip
    assert model.position_lower[0] == -np.inf
    assert model.position_upper[0] == np.inf
    assert model.effort_limit[0] == np.inf
    assert model.velocity_limit[0] == np.inf
    assert not np.isfinite(model.stops.place[:, 0]).any()


def test_limits_of_minus_one_are_none(caplog: pytest.LogCaptureFixture) -> None:
    """So some makers write; the scene may give another."""
    text = changed('effort="80" velocity="4"', 'effort="-1.0" velocity="-1"')
    model = arm(text)
    assert model.effort_limit[0] == model.velocity_limit[0] == np.inf
    for key in ("effort", "velocity"):
        assert f"joint 'shoulder': <limit {key}> is -1: there is none" in caplog.text
    own = {"robot": {"urdf": text}, "joints": {"shoulder": {"limits": {"effort": 7.0}}}}
    assert arm(own).effort_limit[0] == 7.0


CROSSED = {'lower="2.5" upper="-3"': "lower=2.5 upper=-3", 'lower="0.5"': "lower=0.5 upper=0"}


@pytest.mark.parametrize(("given", "words"), CROSSED.items())
def test_a_lower_limit_above_the_upper_one_is_refused(given: str, words: str) -> None:
    """Unless the scene gives both, or the joint is locked."""
    text = changed('lower="-3" upper="2.5"', given)
    with pytest.raises(ModelError, match=rf"^joint 'shoulder': <limit {words}>: lower is above"):
        load_scene(text)
    half = {"joints": {"shoulder": {"limits": {"lower": -3.0}}}}
    with pytest.raises(ModelError, match=r"give both in a scene"):
        load_scene({"robot": {"urdf": text}, **half})
    half["joints"]["shoulder"]["limits"]["upper"] = 2.5
    model = arm({"robot": {"urdf": text}, **half})
    assert (model.position_lower[0], model.position_upper[0]) == (-3.0, 2.5)
    assert arm({"robot": {"urdf": text, "lock": ["shoulder"]}}).joint_names == ("elbow",)
