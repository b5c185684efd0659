# SPDX-License-Identifier: Apache-2.0
"""Mimic joints are known by name: they are told to follow, and may be given what they have."""

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, InvalidInput, load_scene
from arm_dynamics.scene.urdf.joint_names import NamedJoints

GRIPPER = models.dynamics("gripper").model.joint_names  # swing, left_slide
FINGER = models.dynamics("finger").model.joint_names  # spread, knuckle
STILL = np.zeros(2)
REFUSED = {
    "a follower": (["swing", "cover_hinge"], "cover_hinge follows left_slide; command that one"),
    "a stranger": (["left_slid"], "unknown joints left_slid; allowed: .* mean 'left_slide'"),
    "twice": (["swing", "swing"], "joints swing, swing are not all different"),
}


@pytest.mark.parametrize(("names", "words"), REFUSED.values(), ids=REFUSED)
def test_names_are_refused_with_what_to_do(names: list[str], words: str) -> None:
    with pytest.raises(InvalidInput, match=f"^{words}"):
        NamedJoints(names, GRIPPER)


def test_locked_joints_are_told_to_be() -> None:
    scene = {"robot": {"urdf": str(models.FOLDER / "gripper.urdf"), "lock": ["left_slide"]}}
    names = ArmModel(load_scene(scene)).joint_names
    for name in ("left_slide", "right_slide"):
        with pytest.raises(InvalidInput, match=f"'{name}' is locked by the scene"):
            NamedJoints([name], names)


AGREEING = {
    "position": (0.03, -0.011, 0.76, "-0.011"), "velocity": (0.2, -0.14, 2.4, "-0.14"),
    "acceleration": (-1.0, 0.7, -12.0, "0.7"), "effort": (5.0, 0.0, 0.0, "0"),
}  # fmt: skip


@pytest.mark.parametrize("field", AGREEING)
def test_followers_may_be_given_what_they_have(field: str) -> None:
    left, right, cover, due = AGREEING[field]
    names = ["right_slide", "left_slide", "cover_hinge"]
    named = NamedJoints(names, GRIPPER)
    for off in (0.0, 9e-4, float("nan")):
        full = named.spread("point", field, [right + off, left, cover], np.array([7.0, 8.0]))
        np.testing.assert_array_equal(full, [7.0, left])
    words = f"point: right_slide is .*, but right_slide follows left_slide, so {due} is expected;"
    for off in (-2e-3, float("inf")):
        with pytest.raises(InvalidInput, match=words):
            named.spread("point", field, [right + off, left, cover], STILL)


def test_a_follower_of_a_follower_agrees_with_the_leader_of_both() -> None:
    knuckle = 0.4
    tip = 0.6 * (1.1 * knuckle + 0.05) - 0.02
    named = NamedJoints(["tip_joint", "knuckle"], FINGER)
    np.testing.assert_array_equal(named.spread("q", "position", [tip, knuckle], STILL)[1], knuckle)
    with pytest.raises(InvalidInput, match="tip_joint follows knuckle, so 0.274 is"):
        named.spread("q", "position", [knuckle, knuckle], STILL)
    with pytest.raises(InvalidInput, match="^tip_joint follows knuckle; command that one"):
        NamedJoints(["spread", "tip_joint"], FINGER)
