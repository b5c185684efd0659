# SPDX-License-Identifier: Apache-2.0
"""Poses of messages, in the world of the model."""

import numpy as np
import pytest

from arm_dynamics import ArmModel, InvalidInput, load_scene
from arm_dynamics.ros.common.poses import in_world, pose_of
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros

TURNED = """<robot name="turned">
  <link name="ground"/>
  <link name="stand"/>
  <link name="arm"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="mount" type="fixed"><parent link="ground"/><child link="stand"/>
    <origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="hinge" type="continuous"><parent link="stand"/><child link="arm"/></joint>
</robot>"""
HALF = np.sqrt(0.5)


@pytest.fixture(scope="module")
def model() -> ArmModel:
    return ArmModel(load_scene({"robot": {"urdf": TURNED}}))


@pytest.mark.parametrize("frame", ["stand", "link:stand", "joint:mount"])
def test_a_pose_in_a_frame_that_stands_turned(model: ArmModel, frame: str) -> None:
    """A step along its x is one along the world's y, and rotations follow one another."""
    pose = in_world((1.0, 0.0, 0.5, HALF, 0.0, 0.0, HALF), frame, model)
    assert_close(pose.position, [1.0, 3.0, 3.5], ALGEBRA)
    quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # about z, of the stand
    roll = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]  # about x, of the pose
    assert_close(pose.rotation, np.array(quarter) @ roll, ALGEBRA)


@pytest.mark.parametrize("scale", [0.9989, 1.0011, 0.0])
def test_a_quaternion_has_length_one(scale: float) -> None:
    with pytest.raises(InvalidInput, match="expected 1"):
        pose_of((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, scale))
    for length in (0.9991, 1.0009):
        slightly = pose_of((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, length))
        assert_close(slightly.rotation, np.eye(3), ALGEBRA)
