# SPDX-License-Identifier: Apache-2.0
"""Floating and planar joints that a scene locks are fixed at their origin; others are refused."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, ModelError, SceneError, load_scene
from arm_dynamics.model.description import AllJoints, Links

GOOD = (models.FOLDER / "planar_3r.urdf").read_text()
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
