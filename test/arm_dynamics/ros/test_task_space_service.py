# SPDX-License-Identifier: Apache-2.0
"""The service ``~/task_space``: what it answers against the core, and what it refuses."""

from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import TaskSpace as Service
from harness import Ros

import models
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.interfaces import MAX_TERMS_POINTS, TASK_SPACE
from arm_dynamics.task_space import TaskSpace
from tolerances import PINOCCHIO, assert_close

pytestmark = pytest.mark.ros

HAND = "panda_hand"
FIELDS = ("jacobian", "bias", "inertia", "coriolis", "gravity", "inverse", "null_space")


@pytest.fixture
def node(ros: Ros) -> DynamicsNode:
    """Knows the Panda."""
    return ros.add(DynamicsNode, models.scene("panda"))


def ask(node: DynamicsNode, **fields: Any) -> Any:
    request = Service.Request(**{"frame": HAND, **fields})
    return node.answer(TASK_SPACE, request, Service.Response())


def states(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    q, v = rng.normal(size=(2, count, 7))
    return models.dynamics("panda").model.q0 + q, v


def test_a_batch_over_the_wire(ros: Ros, node: DynamicsNode, rng: np.random.Generator) -> None:
    q, v = states(rng, 4)
    request = Service.Request(position=q.ravel(), velocity=v.ravel(), frame=HAND)
    answer = ros.call(Service, "/dynamics/task_space", request)
    assert answer.success, answer.message
    exact = TaskSpace(models.dynamics("panda"), HAND).terms(q, v)
    for field in FIELDS:
        assert_close(getattr(answer, field), getattr(exact, field).ravel(), PINOCCHIO)
    assert_close(answer.twist, exact.velocity.ravel(), PINOCCHIO)
    assert_close(answer.manipulability, exact.manipulability, PINOCCHIO)
    assert_close(answer.condition, exact.condition, PINOCCHIO)
    np.testing.assert_array_equal(answer.damped, exact.damped)
    assert list(answer.axes) == ["x", "y", "z", "rx", "ry", "rz"]
    assert tuple(answer.joint_names) == models.dynamics("panda").joint_names
    assert len(answer.effective_mass) == len(answer.effective_mass_bounded) == 0


def test_pose_is_a_position_and_a_unit_quaternion(
    node: DynamicsNode, rng: np.random.Generator
) -> None:
    q, _ = states(rng, 5)
    pose = np.reshape(ask(node, position=q.ravel()).pose, (5, 7))
    exact = TaskSpace(models.dynamics("panda"), HAND).pose(q)
    assert_close(pose[:, :3], exact.position, PINOCCHIO)
    assert (pose[:, 6] >= 0.0).all()
    for (x, y, z, w), R in zip(pose[:, 3:], exact.rotation, strict=True):
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        assert_close(np.eye(3) + 2 * w * cross + 2 * cross @ cross, R, PINOCCHIO)


@pytest.mark.parametrize("reference", ["local", "world", "local_world_aligned"])
def test_order_of_joints_and_choice_of_axes(
    node: DynamicsNode, rng: np.random.Generator, reference: str
) -> None:
    """The same arm, with its joints in another order in the requests."""
    order, axes = rng.permutation(7), ["rz", "x", "y"]
    names = [node.dynamics.joint_names[i] for i in order]
    q, v = states(rng, 3)
    answer = ask(
        node, joint_names=names, position=q[:, order].ravel(), velocity=v[:, order].ravel(),
        reference=reference, axes=axes, direction=[0.0, 2.0, 0.0],
    )  # fmt: skip
    assert answer.success, answer.message
    assert list(answer.axes) == ["x", "y", "rz"]
    task = TaskSpace(models.dynamics("panda"), HAND, reference, axes)
    exact = task.terms(q, v)
    J = np.reshape(answer.jacobian, (3, 3, 7))
    assert_close(J, exact.jacobian[:, :, order], PINOCCHIO)
    J_bar = np.reshape(answer.inverse, (3, 7, 3))
    assert_close(J_bar, exact.inverse[:, order], PINOCCHIO)
    assert_close(np.reshape(answer.null_space, (3, 7, 7)), np.eye(7) - J_bar @ J, PINOCCHIO)
    assert_close(answer.twist, np.einsum("kij,kj->ki", J, v[:, order]).ravel(), PINOCCHIO)
    assert_close(answer.inertia, exact.inertia.ravel(), PINOCCHIO)
    assert_close(answer.effective_mass, task.effective_mass(q, [0, 1, 0]).mass, PINOCCHIO)


def test_groups_of_axes_and_rest(node: DynamicsNode) -> None:
    zeros = [0.3] * 7
    assert list(ask(node, position=zeros, axes=["position"]).axes) == ["x", "y", "z"]
    answer = ask(node, position=zeros, axes=["orientation"])
    assert list(answer.axes) == ["rx", "ry", "rz"]
    assert not np.any(answer.twist) and not np.any(answer.coriolis)


def test_a_singularity_is_flagged_and_bounded(ros: Ros) -> None:
    node = ros.add(DynamicsNode, models.scene("two_link"))
    positions = [0.2, 0.0, 0.2, 1.0]
    frame = models.dynamics("two_link").model.frame_names[-1]
    plain = {"frame": frame, "reference": "local", "position": positions}
    axes = [a for a in "xyz" if np.any(ask(node, **plain, axes=[a]).jacobian)]
    assert len(axes) == 2
    answer = ask(node, **plain, axes=axes, direction=[1.0, 0.0])
    assert answer.success, answer.message
    assert list(answer.damped) == [True, False]
    assert answer.condition[0] > 1e12 > 100 > answer.condition[1]
    assert answer.manipulability[0] < 1e-9 < 0.01 < answer.manipulability[1]
    assert np.isfinite(answer.inertia).all()
    assert sum(answer.effective_mass_bounded) <= 1


BAD = [
    ({"frame": ""}, "frame '' does not exist; allowed: panda_joint1"),
    ({"frame": "paw"}, "frame 'paw' does not exist"),
    ({"frame": "panda_link0"}, "frame 'panda_link0' does not move"),
    ({"reference": ""}, "reference = ''; allowed: local, world, local_world_aligned"),
    ({"reference": "hand"}, "reference = 'hand'"),
    ({"axes": ["x", "w"]}, "allowed: pose, position, orientation, or different names"),
    ({"axes": ["x", "x"]}, "different names"),
    ({"direction": [1.0, 0.0]}, "direction"),
    ({"direction": [0.0] * 6}, "direction"),
    ({"direction": [np.nan] * 6}, "direction"),
    ({"position": [np.nan] * 7}, "position of joint 'panda_joint1' at point 0 is nan"),
    ({"velocity": [0.0] * 3}, "velocity has 3 numbers; allowed: 0 or 7"),
    ({"velocity": [1e200] * 7}, "too large"),
    ({"joint_names": ["nobody"] * 7}, "unknown joints nobody"),
    ({"position": [0.0] * 7 * (MAX_TERMS_POINTS + 1)}, f"up to {MAX_TERMS_POINTS} in one"),
]


def test_bad_requests_are_refused_and_the_node_goes_on(node: DynamicsNode) -> None:
    good = {"position": [0.1, -0.8, 0.2, -2.0, 0.1, 1.5, 0.3]}
    for fields, complaint in BAD:
        answer = ask(node, **{**good, **fields})
        assert not answer.success
        assert complaint in answer.message
        assert len(answer.message) < 1000
        assert len(answer.jacobian) == len(answer.axes) == 0
        assert ask(node, **good).success
