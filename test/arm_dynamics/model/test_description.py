# SPDX-License-Identifier: Apache-2.0
"""All joints and links of a description, against Pinocchio's model with nothing locked."""

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_dynamics.model.description import AllJoints, Links
from tolerances import ALGEBRA, assert_close

GRIPPER = """
<robot name="gripper">
  <link name="base"/>
  <link name="palm"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
    izz="1"/></inertial></link>
  <link name="left"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
    izz="1"/></inertial></link>
  <link name="right"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
    izz="1"/></inertial></link>
  <link name="lid"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
    izz="1"/></inertial></link>
  <link name="tip"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="palm"/>
    <origin xyz="0 0 1"/><axis xyz="0 0 1"/></joint>
  <joint name="open" type="prismatic"><parent link="palm"/><child link="left"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>
  <joint name="follow" type="prismatic"><parent link="palm"/><child link="right"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>
    <mimic joint="open" multiplier="-2" offset="0.1"/></joint>
  <joint name="hinge" type="revolute"><parent link="palm"/><child link="lid"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="9"/></joint>
  <joint name="tool" type="fixed"><parent link="left"/><child link="tip"/>
    <origin xyz="0 0 0.5"/></joint>
</robot>
"""


@pytest.fixture
def model() -> ArmModel:
    """A continuous joint, a prismatic one with a follower, a joint locked at half a radian."""
    given = {"urdf": GRIPPER, "lock": ["hinge"]}
    return ArmModel(load_scene({"robot": given, "initial": {"position": {"hinge": 0.5}}}))


def test_followers_and_locked_joints_are_reported(model: ArmModel) -> None:
    joints = AllJoints(model)
    assert joints.names[: model.n] == model.joint_names == ("turn", "open")
    position = dict(zip(joints.names, joints.positions(np.array([4.0, 0.3])), strict=True))
    follower = -2 * 0.3 + 0.1
    assert position == pytest.approx({"open": 0.3, "turn": 4.0, "follow": follower, "hinge": 0.5})
    velocity = dict(zip(joints.names, joints.velocities(np.array([7.0, 0.2])), strict=True))
    assert velocity == pytest.approx({"open": 0.2, "turn": 7.0, "follow": -0.4, "hinge": 0.0})


def test_links_are_where_their_joints_put_them(model: ArmModel) -> None:
    links, joints = Links(model), AllJoints(model)
    position = joints.positions(np.array([4.0, 0.3]))
    links.place(dict(zip(joints.names, position.tolist(), strict=True)))
    assert links.root == "base"
    assert dict(links.fixed) == {"palm": "lid", "left": "tip"}
    assert sorted(links.moving) == [("base", "palm"), ("palm", "left"), ("palm", "right")]
    moving = dict(zip([child for _, child in links.moving], links.transforms(), strict=True))
    half = 4.0 / 2.0
    assert_close(moving["left"], [0.3, 0, 0, 0, 0, 0, 1], ALGEBRA)
    assert_close(moving["right"], [-0.5, 0, 0, 0, 0, 0, 1], ALGEBRA)
    turned = [0, 0, 1, 0, 0, np.sin(half), np.cos(half)]
    assert_close(abs(moving["palm"]), np.abs(turned), ALGEBRA)
    fixed = dict(zip([child for _, child in links.fixed], links.fixed_transforms(), strict=True))
    assert_close(fixed["lid"], [0, 0, 0, 0, np.sin(0.25), 0, np.cos(0.25)], ALGEBRA)
    assert_close(fixed["tip"], [0, 0, 0.5, 0, 0, 0, 1], ALGEBRA)


def test_transforms_together_give_the_frames_of_the_arm(
    robot: str, rng: np.random.Generator
) -> None:
    """Each link's place in the world, down the tree, is the one of the model that is simulated."""
    model = ArmModel(models.scene(robot))
    links, joints = Links(model), AllJoints(model)
    q = rng.uniform(-1.0, 1.0, model.n)
    links.place(dict(zip(joints.names, joints.positions(q).tolist(), strict=True)))
    data = model.pin.createData()
    pin.framesForwardKinematics(model.pin, data, model.configuration(q))
    pairs = [*links.fixed, *links.moving]
    steps = [*links.fixed_transforms(), *links.transforms()]
    inside = {child: (parent, step) for (parent, child), step in zip(pairs, steps, strict=True)}
    names = {frame.name for frame in model.pin.frames if frame.type == pin.FrameType.BODY}
    assert names == {*inside, links.root}
    for name in inside:
        place, link = pin.SE3.Identity(), name
        while link != links.root:
            link, step = inside[link]
            place = pin.XYZQUATToSE3(step) * place
        expected = data.oMf[model.pin.getFrameId(name, pin.FrameType.BODY)]
        assert_close(place.homogeneous, expected.homogeneous, ALGEBRA)
