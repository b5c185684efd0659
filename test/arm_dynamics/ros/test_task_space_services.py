# SPDX-License-Identifier: Apache-2.0
"""Services ``~/task_space`` and ``~/inverse_kinematics``: their answers, and what they refuse."""

from typing import Any

import numpy as np
import pytest
from harness import Ros

import models
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.interfaces import (
    INVERSE_KINEMATICS,
    MAX_POSES,
    MAX_TERMS_POINTS,
    TASK_SPACE,
    Service,
)
from arm_dynamics.task_space import TaskSpace, quaternions
from tolerances import PINOCCHIO, assert_close

pytestmark = pytest.mark.ros

FRAME = "panda_hand"
DYNAMICS = models.dynamics("panda")
HAND = TaskSpace(DYNAMICS, FRAME)
HOME = DYNAMICS.model.q0
FIELDS = ("jacobian", "bias", "inertia", "coriolis", "gravity", "inverse", "null_space")


@pytest.fixture
def node(ros: Ros) -> DynamicsNode:
    """Knows the Panda."""
    return ros.add(DynamicsNode, models.scene("panda"))


def ask(node: DynamicsNode, service: Service, **fields: Any) -> Any:
    request = service.type.Request(**{"frame": FRAME, **fields})
    return node.answer(service, request, service.type.Response())


def states(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    q, v = rng.normal(size=(2, count, 7))
    return HOME + q, v


def test_a_batch_over_the_wire(ros: Ros, node: DynamicsNode, rng: np.random.Generator) -> None:
    q, v = states(rng, 4)
    request = TASK_SPACE.type.Request(position=q.ravel(), velocity=v.ravel(), frame=FRAME)
    answer = ros.call(TASK_SPACE.type, "/dynamics/task_space", request)
    assert answer.success, answer.message
    exact = HAND.terms(q, v)
    for field in FIELDS:
        assert_close(getattr(answer, field), getattr(exact, field).ravel(), PINOCCHIO)
    assert_close(answer.twist, exact.velocity.ravel(), PINOCCHIO)
    assert_close(answer.manipulability, exact.manipulability, PINOCCHIO)
    assert_close(answer.condition, exact.condition, PINOCCHIO)
    np.testing.assert_array_equal(answer.damped, exact.damped)
    assert list(answer.axes) == ["x", "y", "z", "rx", "ry", "rz"]
    assert tuple(answer.joint_names) == DYNAMICS.joint_names
    assert len(answer.effective_mass) == len(answer.effective_mass_bounded) == 0
    pose = np.reshape(answer.pose, (4, 7))
    assert_close(pose[:, :3], HAND.pose(q).position, PINOCCHIO)
    assert (pose[:, 6] >= 0.0).all()
    for (x, y, z, w), R in zip(pose[:, 3:], HAND.pose(q).rotation, strict=True):
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        assert_close(np.eye(3) + 2 * w * cross + 2 * cross @ cross, R, PINOCCHIO)


def test_order_of_joints_and_choice_of_axes(node: DynamicsNode, rng: np.random.Generator) -> None:
    """The same arm, with its joints in another order in the requests."""
    order, axes = rng.permutation(7), ["rz", "x", "y"]
    names = [DYNAMICS.joint_names[i] for i in order]
    q, v = states(rng, 3)
    answer = ask(
        node, TASK_SPACE, joint_names=names, position=q[:, order].ravel(),
        velocity=v[:, order].ravel(), reference="local", axes=axes, direction=[0.0, 2.0, 0.0],
    )  # fmt: skip
    assert answer.success, answer.message
    assert list(answer.axes) == ["x", "y", "rz"]
    task = TaskSpace(DYNAMICS, FRAME, "local", axes)
    exact = task.terms(q, v)
    J = np.reshape(answer.jacobian, (3, 3, 7))
    assert_close(J, exact.jacobian[:, :, order], PINOCCHIO)
    J_bar = np.reshape(answer.inverse, (3, 7, 3))
    assert_close(J_bar, exact.inverse[:, order], PINOCCHIO)
    assert_close(np.reshape(answer.null_space, (3, 7, 7)), np.eye(7) - J_bar @ J, PINOCCHIO)
    assert_close(answer.twist, np.einsum("kij,kj->ki", J, v[:, order]).ravel(), PINOCCHIO)
    assert_close(answer.inertia, exact.inertia.ravel(), PINOCCHIO)
    assert_close(answer.effective_mass, task.effective_mass(q, [0, 1, 0]).mass, PINOCCHIO)


def flat(q: np.ndarray) -> np.ndarray:
    pose = HAND.pose(q)
    return np.hstack([pose.position, quaternions(pose.rotation)]).ravel()


def test_poses_of_a_path_have_neighbouring_positions(node: DynamicsNode) -> None:
    way = np.linspace(HOME, HOME + 0.3, 50)
    answer = ask(node, INVERSE_KINEMATICS, pose=flat(way), seed=HOME)
    assert answer.success
    assert abs(np.diff(np.array(answer.position).reshape(50, 7), axis=0)).max() < 0.05


def test_of_the_first_pose_that_is_missed_it_is_said_by_how_much_and_at_which_limits(
    node: DynamicsNode,
) -> None:
    good, other = flat(HOME[None]), flat(HOME[None])
    missed = good + [0, 0, -3.0, 0, 0, 0, 0]
    other[:3] += 9.0
    answer = ask(
        node, INVERSE_KINEMATICS, pose=[*good, *missed, *other], axes=["position"], seed=HOME
    )
    assert answer.message.endswith("rad; at a limit: panda_joint2")
    assert f"2 of 3 poses of frame '{FRAME}' cannot be reached; pose 1 misses" in answer.message
    assert f"{answer.distance[1]:.3g} m and {answer.angle[1]:.3g} rad" in answer.message


GOOD = {
    TASK_SPACE: {"position": [0.1, -0.8, 0.2, -2.0, 0.1, 1.5, 0.3]},
    INVERSE_KINEMATICS: {"pose": flat(HOME[None])},
}
BAD = [
    (TASK_SPACE, {"frame": "panda_link0"}, "frame 'panda_link0' does not move"),
    (TASK_SPACE, {"reference": ""}, "reference = ''; allowed: local, world, local_world_aligned"),
    (TASK_SPACE, {"axes": ["x", "x"]}, "different names"),
    (TASK_SPACE, {"direction": [0.0] * 6}, "direction"),
    (TASK_SPACE, {"velocity": [1e200] * 7}, "too large"),
    (TASK_SPACE, {"position": [0.0] * 7 * (MAX_TERMS_POINTS + 1)}, f"up to {MAX_TERMS_POINTS} in"),
    (INVERSE_KINEMATICS, {"pose": []}, "pose has 0 numbers; allowed: 7 for each of up to 1000"),
    (INVERSE_KINEMATICS, {"pose": [0.0] * 7}, "quaternion"),
    (INVERSE_KINEMATICS, {"pose": [0.0] * 7 * (MAX_POSES + 1)}, "allowed: 7 for each of up to"),
    (INVERSE_KINEMATICS, {"seed": [0.0] * 6}, "seed has 6 numbers; allowed: 0 or 7"),
    (INVERSE_KINEMATICS, {"joint_names": ["nobody"]}, "unknown joints nobody"),
]


def test_bad_requests_are_refused_and_the_node_goes_on(node: DynamicsNode) -> None:
    for service, fields, complaint in BAD:
        answer = ask(node, service, **{**GOOD[service], **fields})
        assert not answer.success
        assert complaint in answer.message and len(answer.message) < 1000
        results = answer.jacobian if service is TASK_SPACE else answer.position
        assert len(results) == 0
        assert ask(node, service, **GOOD[service]).success
