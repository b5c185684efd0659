# SPDX-License-Identifier: Apache-2.0
"""Joints of a scene and of a recording that calls them otherwise."""

import numpy as np
import pytest

from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord
from arm_studies.identification.names import mapped


def record(*names: str) -> JointRecord:
    """The position of joint k is k."""
    q = np.tile(np.arange(len(names), dtype=float), (3, 1))
    return JointRecord.of(names, [0.0, 0.1, 0.2], q, q)


@pytest.mark.parametrize(
    ("recorded", "joints", "places"),
    [
        (("left_elbow", "elbow"), ["elbow"], [1]),  # its own name comes first
        (("fer_joint2", "fer_joint1"), ["panda_joint1", "panda_joint2"], [1, 0]),
        (("robot/elbow", "wrist"), ["wrist", "elbow"], [1, 0]),
    ],
)
def test_a_joint_is_found_under_its_names(
    recorded: tuple[str, ...], joints: list[str], places: list[int]
) -> None:
    found = mapped(record(*recorded), joints)
    assert found.joint_names == tuple(joints)
    np.testing.assert_array_equal(found.q[0], places)
    assert bool(found.notes) == ([recorded[k] for k in places] != joints)


def test_a_joint_that_two_may_be_is_not_guessed() -> None:
    with pytest.raises(InvalidInput, match="no joint matches elbow.*such as --map elbow=left_elb"):
        mapped(record("left_elbow", "right_elbow"), ["elbow"])
