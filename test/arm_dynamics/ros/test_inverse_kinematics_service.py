# SPDX-License-Identifier: Apache-2.0
"""The service ``~/inverse_kinematics``: against forward kinematics, and what it refuses."""

import re
from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import InverseKinematics as Service
from harness import Ros

import models
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.interfaces import INVERSE_KINEMATICS, MAX_POSES
from arm_dynamics.task_space import TaskSpace, quaternions
from tolerances import assert_close

pytestmark = pytest.mark.ros

FRAME = "panda_hand"
HAND = TaskSpace(models.dynamics("panda"), FRAME)
MODEL = models.dynamics("panda").model


@pytest.fixture
def node(ros: Ros) -> DynamicsNode:
    """Knows the Panda."""
    return ros.add(DynamicsNode, models.scene("panda"))


def ask(node: DynamicsNode, **fields: Any) -> Any:
    request = Service.Request(**{"frame": FRAME, **fields})
    return node.answer(INVERSE_KINEMATICS, request, Service.Response())


def within_limits(rng: np.random.Generator, count: int) -> np.ndarray:
    return MODEL.q0 + rng.uniform(-0.2, 0.2, (count, 7))


def flat(q: np.ndarray) -> np.ndarray:
    pose = HAND.pose(q)
    return np.hstack([pose.position, quaternions(pose.rotation)]).ravel()


def test_a_batch_over_the_wire(ros: Ros, node: DynamicsNode, rng: np.random.Generator) -> None:
    poses = flat(within_limits(rng, 5))
    answer = ros.call(
        Service, "/dynamics/inverse_kinematics", Service.Request(frame=FRAME, pose=poses)
    )
    assert answer.success, answer.message
    found = np.array(answer.position).reshape(5, 7)
    assert_close(flat(found), poses, 2e-9)
    assert np.all((found >= MODEL.position_lower) & (found <= MODEL.position_upper))
    assert list(answer.reached) == [True] * 5
    assert max(*answer.distance, *answer.angle) < 1e-9
    assert tuple(answer.joint_names) == MODEL.joint_names


def test_poses_of_a_path_have_neighbouring_answers(node: DynamicsNode) -> None:
    way = np.linspace(MODEL.q0, MODEL.q0 + 0.3, 50)
    answer = ask(node, pose=flat(way), seed=MODEL.q0)
    assert answer.success
    assert abs(np.diff(np.array(answer.position).reshape(50, 7), axis=0)).max() < 0.05


@pytest.mark.parametrize(
    ("offset", "ending"),
    [([3.0, 0.0, 0.0], r"rad$"), ([0.0, 0.0, -3.0], r"rad; at a limit: panda_joint2$")],
)
def test_of_the_first_pose_that_is_missed_it_is_said_by_how_much_and_at_which_limits(
    node: DynamicsNode, offset: list[float], ending: str
) -> None:
    good, other = flat(MODEL.q0[None]), flat(MODEL.q0[None])
    missed = good + [*offset, 0, 0, 0, 0]
    other[:3] += 9.0
    answer = ask(node, pose=[*good, *missed, *other], axes=["position"], seed=MODEL.q0)
    assert re.search(ending, answer.message)
    assert f"2 of 3 poses of frame '{FRAME}' cannot be reached; pose 1 misses" in answer.message
    assert f"{answer.distance[1]:.3g} m and {answer.angle[1]:.3g} rad" in answer.message


BAD = [
    ({"frame": "paw"}, "frame 'paw' does not exist"),
    ({"frame": "panda_link0"}, "does not move"),
    ({"axes": ["up"]}, "selection = 'up'"),
    ({"pose": []}, "pose has 0 numbers; allowed: 7 for each of up to 1000 poses"),
    ({"pose": [0.0] * 6}, "pose has 6 numbers"),
    ({"pose": [0.0] * 7}, "quaternion"),
    ({"pose": [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}, "pose"),
    ({"pose": [0.0] * 7 * (MAX_POSES + 1)}, "allowed: 7 for each of up to 1000"),
    ({"seed": [0.0] * 6}, "seed has 6 numbers; allowed: 0 or 7"),
    ({"seed": [np.inf] + [0.0] * 6}, "seed of joint 'panda_joint1' at point 0 is inf"),
    ({"joint_names": ["nobody"]}, "unknown joints nobody"),
]


def test_bad_questions_are_refused(node: DynamicsNode) -> None:
    for fields, complaint in BAD:
        answer = ask(node, **{"pose": flat(MODEL.q0[None]), **fields})
        assert not answer.success
        assert complaint in answer.message
        assert len(answer.position) == len(answer.reached) == 0
