# SPDX-License-Identifier: Apache-2.0
"""A bad robot description is refused, naming the wrong element; joints that must be locked."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, ModelError, SceneError, load_scene
from arm_dynamics.model.description import AllJoints, Links
from arm_dynamics.scene.urdf.description import DEEPEST, read_urdf

GOOD = (models.FOLDER / "planar_3r.urdf").read_text()
JOINT2 = '<joint name="joint2" type="revolute">'


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def following(leader: str) -> str:
    """The arm whose second joint follows another."""
    parent = '<parent link="link1"/>'
    return changed(parent, f'{parent}<mimic joint="{leader}"/>')


PIN = (
    '<link name="x"/><joint name="pin" type="fixed"><parent link="base"/><child link="x"/></joint>'
)
UPPER = '<link name="link1">'
BAD = [
    (changed(UPPER, f'<link name="link2"/>{UPPER}'), "two <link> are called 'link2'"),
    (changed(UPPER, f"<link/>{UPPER}"), "a <link> has no name"),
    (changed(UPPER, f'<link name="x"/>{UPPER}'), "one root link expected, found 2: base, x"),
    (changed('<mass value="2"/>', ""), "<inertial> without <mass value="),
    (changed(' iyy="0.015"', ""), "<inertia> without iyy"),
    (changed('<axis xyz="0 -1 0"/>', '<origin quat_xyzw="0 0 0 1"/>'), "quat_xyzw"),
    (changed('<mass value="2"/>', '<mass value="-2"/>'), "mass.*-2"),
    (changed(JOINT2, f'{JOINT2}<dynamics damping="-1"/>'), "damping.*-1"),
    (changed('<child link="link2"/>', '<child link="hand"/>'), "joint2.*hand"),
    (changed('<child link="link3"/>', '<child link="link1"/>'), "link1.*has a parent joint"),
    (
        changed('<parent link="base"/>', '<parent link="link3"/>'),
        "link1, link2, link3 form a loop",
    ),
    (
        changed('ixy="0" ixz="0" iyy="0.015"', 'ixy="0.05" ixz="0" iyy="0.015"'),
        "link2.*moments -0",
    ),
    (changed('iyy="0.015"', 'iyy="-1.6e-12"'), "link2.*inertia iyy='-1.6e-12'"),
    (changed("0 -1 0", "0 0.999e-9 0"), "joint1.*axis '0 0.999e-9 0' has no direction"),
    (following("thumb"), "joint2.*thumb"),
    (following("joint2"), "joint2.*mimics 'joint2', which is that joint itself"),
    (following("pin").replace(JOINT2, PIN + JOINT2), "joint2.*mimics 'pin', which does not move"),
    (following("joint3").replace('"link2"/>', '"link2"/><mimic joint="joint2"/>'), "joint[23]"),
]


@pytest.mark.parametrize(("text", "words"), BAD)
def test_bad_description(text: str, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Dynamics(text)


FINE = {
    "a continuous joint has no positions to limit": changed(
        'lower="-3" upper="3"', 'lower="3" upper="-3"'
    ).replace('"joint1" type="revolute"', '"joint1" type="continuous"'),
    "a short axis": changed('<axis xyz="0 -1 0"/>', '<axis xyz="0 1e-9 0"/>'),
    "a fixed joint has no axis": changed(
        JOINT2, JOINT2.replace("revolute", "fixed") + '<axis xyz="0 0 0"/>'
    ),
    "rounding of an inertia": changed('iyy="0.015"', 'iyy="-1.4e-12"'),
}


@pytest.mark.parametrize("text", FINE.values(), ids=FINE)
def test_what_is_unusual_but_sound_is_read(text: str) -> None:
    assert list(read_urdf(text).joints) == ["joint1", "joint2", "joint3"]


def chain(joints: int) -> str:
    """A description of links one after another."""
    links = "".join(f'<link name="l{i}"/>' for i in range(joints + 1))
    parts = "".join(
        f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
        for i in range(joints)
    )
    return f'<robot name="chain">{links}{parts}</robot>'


def test_links_too_deep_for_the_stack_of_the_parser_are_refused() -> None:
    """4000 would end the process."""
    assert len(read_urdf(chain(DEEPEST)).links) == DEEPEST + 1
    with pytest.raises(
        ModelError, match="'l4000' is 4000 joints away from its root; at most 1000"
    ):
        read_urdf(chain(4000))
    turning = chain(DEEPEST - 1).replace('"j7" type="fixed"', '"j7" type="continuous"')
    assert Dynamics(turning).joint_names == ("j7",)


def test_a_long_loop_is_named_by_its_links() -> None:
    text = chain(5000).replace('<parent link="l0"/>', '<parent link="l4"/>')
    with pytest.raises(ModelError, match=r"links (l[1-4](, )?){4} form a loop"):
        read_urdf(text)


BASE = """<link name="floor"/>
<joint name="ride" type="{kind}"><parent link="floor"/><child link="base"/>
<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><axis xyz="0 0 1"/></joint></robot>"""
held = pytest.mark.parametrize("kind", ["floating", "planar"])


def riding(kind: str, **scene: Any) -> dict[str, Any]:
    urdf = GOOD.replace("</robot>", BASE.format(kind=kind))
    return {"robot": {"urdf": urdf, "lock": ["ride"]}, **scene}


@held
def test_a_locked_one_is_fixed(kind: str) -> None:
    own = ArmModel(load_scene(riding(kind, initial={"velocity": {"joint1": 0.2}})))
    fixed = ArmModel(load_scene(riding("fixed")["robot"]["urdf"]))
    np.testing.assert_array_equal(own.v0, [0.2, 0.0, 0.0])
    assert own.joint_names == fixed.joint_names == ("joint1", "joint2", "joint3")
    assert own.whole == fixed.whole
    assert AllJoints(own).names == AllJoints(fixed).names
    assert Links(own).fixed == Links(fixed).fixed
    assert ("floor", "base") in Links(own).fixed


@held
def test_it_takes_no_position_and_no_settings(kind: str) -> None:
    for entry in ({"initial": {"position": {"ride": 0.0}}}, {"joints": {"ride": {}}}):
        with pytest.raises(SceneError, match="joint 'ride', which is fixed"):
            load_scene(riding(kind, **entry))


@held
def test_it_must_be_locked(kind: str) -> None:
    scene = {"robot": {"urdf": riding(kind)["robot"]["urdf"], "lock": ["joint1"]}}
    with pytest.raises(ModelError, match=f"'ride': type '{kind}'.*'robot.lock: \\[ride\\]'"):
        load_scene(scene)


def test_nothing_can_follow_it() -> None:
    scene = riding("floating")
    follower = '<parent link="link1"/><mimic joint="ride"/>'
    scene["robot"]["urdf"] = scene["robot"]["urdf"].replace('<parent link="link1"/>', follower)
    with pytest.raises(ModelError, match="joint 'joint2': mimics 'ride', which does not move"):
        load_scene(scene)
