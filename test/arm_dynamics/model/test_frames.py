# SPDX-License-Identifier: Apache-2.0
"""Frames by name where a link and a joint have the same one: the link is meant, everywhere."""

from typing import Any

import numpy as np
import pytest

from arm_dynamics import ArmModel, Dynamics, InvalidInput, SceneError, load_scene
from arm_sim import Simulator
from arm_sim.view.shapes import visuals_of
from tolerances import PINOCCHIO, assert_close

URDF = """<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.04"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.15 0 0"/><mass value="1.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="tool"/>
  <joint name="{first}" type="continuous"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.1"/><axis xyz="0 0 1"/></joint>
  <joint name="{second}" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="{third}" type="fixed"><parent link="fore"/><child link="tool"/>
    <origin xyz="0.3 0 0"/></joint>
</robot>"""
DISTINCT = URDF.format(first="shoulder", second="elbow", third="wrist")
ALIKE = {
    "the joint that moves the link": URDF.format(first="upper", second="fore", third="tool"),
    "a joint that moves another link": URDF.format(first="fore", second="upper", third="base"),
}
EXTRAS: dict[str, Any] = {
    "payloads": [{"frame": "fore", "mass": 1.0, "com": [0.1, 0, 0]}],
    "springs": [
        {"frames": ["upper", "base"], "points": [[0.1, 0, 0.1], [0, 0, 1]], "stiffness": 90}
    ],
    "constraints": [
        {"type": "plane", "frames": ["fore", "world"], "points": [[0.2, 0, 0], [0, 0, 0]]},
        {"type": "contact", "frame": "tool", "plane": {"frame": "base", "point": [0, 0, -1]}},
    ],
    "initial": {"position": {}},
}
alike = pytest.mark.parametrize("urdf", ALIKE.values(), ids=ALIKE)


def scene(urdf: str, **more: Any) -> dict[str, Any]:
    return {"robot": {"urdf": urdf}, **more}


@alike
def test_payloads_springs_constraints_and_contacts_are_on_the_link(urdf: str) -> None:
    sims = [Simulator(scene(text, **EXTRAS)) for text in (urdf, DISTINCT)]
    motions = [sim.run(0.02, [0.5, -0.3]).q for sim in sims]
    np.testing.assert_array_equal(*motions)
    q, v = sims[0].state.q, sims[0].state.v
    assert_close(*[sim.dynamics.inverse(q, v, q) for sim in sims], PINOCCHIO)
    assert sims[0].model.constraint_rows == sims[1].model.constraint_rows


@alike
def test_poses_and_the_view_are_those_of_the_link(urdf: str) -> None:
    """And every frame is listed once."""
    own, other = Dynamics(urdf), Dynamics(DISTINCT)
    for frame in ("upper", "tool"):
        q = np.array([0.3, -0.7])
        np.testing.assert_array_equal(own.pose(q, frame), other.pose(q, frame))
    seen = [[x.placement.homogeneous for x in visuals_of(dyn.model)] for dyn in (own, other)]
    np.testing.assert_array_equal(*seen)
    names = own.model.frame_names
    assert len(names) == len(set(names)) and {"base", "upper", "fore", "tool"} < set(names)


@alike
def test_a_scene_may_say_which_is_meant(urdf: str) -> None:
    """With ``joint:`` and ``link:`` all is as if the names were distinct."""
    _, first, second = ArmModel(load_scene(urdf)).whole.names
    third = "tool" if '"tool" type' in urdf else "base"
    joints = dict(zip(("shoulder", "elbow", "wrist"), (first, second, third), strict=True))

    def extras(wrist: str, elbow: str) -> dict[str, Any]:
        return {
            "payloads": [{"frame": wrist, "mass": 1.0, "com": [0.1, 0, 0]}],
            "springs": [
                {"frames": [elbow, "link:base"], "points": [[0, 0, 0], [0, 0, 1]],
                 "stiffness": 90}
            ],
        }  # fmt: skip

    expected = Dynamics(scene(DISTINCT, **extras("wrist", "elbow")))
    own = Dynamics(scene(urdf, **extras(f"joint:{third}", f"joint:{second}")))
    q, v = np.array([0.3, -0.7]), np.array([0.4, 0.9])
    assert_close(own.inverse(q, v, v), expected.inverse(q, v, v), PINOCCHIO)
    for name, twin in joints.items():
        np.testing.assert_array_equal(own.pose(q, f"joint:{twin}"), expected.pose(q, name))
    for link in ("upper", "fore", "tool"):
        np.testing.assert_array_equal(own.pose(q, link), own.pose(q, f"link:{link}"))


def test_what_is_said_to_be_a_link_or_a_joint_must_be_one() -> None:
    for frame in ("joint:upper", "link:shoulder", "link:", "body:upper"):
        with pytest.raises(SceneError, match=f"'payloads.0.frame' = '{frame}' does not exist"):
            load_scene(scene(DISTINCT, payloads=[{"frame": frame, "mass": 1.0}]))
        with pytest.raises(InvalidInput, match=f"frame '{frame}' does not exist"):
            Dynamics(DISTINCT).pose(np.zeros(2), frame)


@alike
def test_the_joint_can_be_locked(urdf: str) -> None:
    first, held = Dynamics(urdf).joint_names
    locked = Dynamics({"robot": {"urdf": urdf, "lock": [held]}})
    assert locked.joint_names == (first,)
    expected = Dynamics({"robot": {"urdf": DISTINCT, "lock": ["elbow"]}})
    assert_close(locked.gravity([0.4]), expected.gravity([0.4]), PINOCCHIO)
