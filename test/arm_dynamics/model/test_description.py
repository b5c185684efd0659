# SPDX-License-Identifier: Apache-2.0
"""All joints and links of a description, against Pinocchio's model with nothing locked."""

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_dynamics.model.description import AllJoints, Links
from tolerances import ALGEBRA, assert_close


def gripper() -> ArmModel:
    """A slide whose two followers are an offset, and a joint locked at half a radian."""
    urdf = str(models.FOLDER / "gripper.urdf")
    start = {"position": {"swing": 0.5}}
    return ArmModel(load_scene({"robot": {"urdf": urdf, "lock": ["swing"]}, "initial": start}))


def test_followers_and_locked_joints_are_reported() -> None:
    joints = AllJoints(gripper())
    assert joints.names[0] == "left_slide"
    position = dict(zip(joints.names, joints.positions(np.array([0.03])), strict=True))
    assert position == pytest.approx(
        {"left_slide": 0.03, "right_slide": -0.7 * 0.03 + 0.01, "cover_hinge": 0.76, "swing": 0.5}
    )
    velocity = dict(zip(joints.names, joints.velocities(np.array([0.2])), strict=True))
    assert velocity == pytest.approx(
        {"left_slide": 0.2, "right_slide": -0.14, "cover_hinge": 2.4, "swing": 0.0}
    )


def test_transforms_together_give_the_frames_of_the_arm(
    robot: str, rng: np.random.Generator
) -> None:
    """Each link's place in the world, down the tree, is the one of the model that is simulated."""
    model = gripper() if robot == "gripper" else ArmModel(models.scene(robot))
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
