# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics through the client and ``./arm call``."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forging import running
from typist import Typist, answer

import models
from arm_dynamics import InvalidInput, Unreachable
from arm_dynamics.client import ArmClient, NotReached
from arm_dynamics.exceptions import Refused
from arm_dynamics.task_space import InverseKinematics, TaskSpace, quaternions
from tolerances import assert_close

pytestmark = pytest.mark.ros

FRAME, FIND = "panda_hand", ("inverse-kinematics", "--frame")
HAND = TaskSpace(models.dynamics("panda"), FRAME)
ARM = models.dynamics("panda").model
REACHED = 2e-9  # [m], [rad]; the search promises half of it


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[int]:
    """A domain with a dynamics node that knows the Panda."""
    logs, scene = tmp_path_factory.mktemp("log"), str(models.SCENES / "panda.yaml")
    with running(forge, logs, ("dynamics", scene)) as number:
        yield number


@pytest.fixture(scope="module")
def panda(domain: int) -> Iterator[ArmClient]:
    """A client of that node."""
    with ArmClient(timeout=20.0, domain=domain) as client:
        yield client


@pytest.fixture
def arm(domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Typist:
    """Runs a command in the domain of the nodes."""
    return Typist(domain, monkeypatch, capfd)


def poses(q: Any) -> np.ndarray:
    """Forward kinematics: (7,) for (7,), (k, 7) for (k, 7).

    Of q and -q, which are one rotation, that whose largest component is positive.
    """
    pose = HAND.pose(np.asarray(q))
    turn = quaternions(pose.rotation)
    largest = np.take_along_axis(turn, np.abs(turn).argmax(axis=-1, keepdims=True), axis=-1)
    return np.concatenate([pose.position, np.sign(largest) * turn], axis=-1)


def near_home(rng: np.random.Generator, count: int) -> np.ndarray:
    return ARM.q0 + rng.uniform(-0.2, 0.2, (count, 7))


def far(pose: np.ndarray) -> np.ndarray:
    return pose + [3.0, 0, 0, 0, 0, 0, 0]


def test_positions_found_bring_the_frame_to_the_pose(
    panda: ArmClient, rng: np.random.Generator
) -> None:
    q = near_home(rng, 1)[0]
    wanted = poses(q)
    found = panda.inverse_kinematics(FRAME, wanted)
    assert found.joint_names == ARM.joint_names
    assert found.q.shape == (7,)
    assert found.reached.shape == found.distance.shape == found.angle.shape == ()
    assert found.reached
    assert_close(poses(found.q), wanted, REACHED)
    assert np.all((found.q >= ARM.position_lower) & (found.q <= ARM.position_upper))
    assert_close(found.q, InverseKinematics(HAND).solve(HAND.pose(q)).q, 1e-6)


def test_a_path_of_poses_is_answered_by_neighbours(panda: ArmClient) -> None:
    way = np.linspace(ARM.q0, ARM.q0 + 0.3, 30)
    found = panda.inverse_kinematics(FRAME, poses(way), ARM.q0)
    assert found.q.shape == (30, 7)
    assert found.reached.tolist() == [True] * 30
    assert max(found.distance.max(), found.angle.max()) < REACHED
    assert_close(poses(found.q), poses(way), REACHED)
    assert abs(np.diff(found.q, axis=0)).max() < 0.05


def test_seeds_and_joints_in_any_order(panda: ArmClient, rng: np.random.Generator) -> None:
    q, back = near_home(rng, 3), ARM.joint_names[::-1]
    found = panda.inverse_kinematics(FRAME, poses(q), q[:, ::-1], joint_names=back)
    assert found.joint_names == back
    np.testing.assert_array_equal(found.q, q[:, ::-1])


@pytest.mark.parametrize("axes", ["position", ("x", "y", "z")])
def test_some_axes_alone(panda: ArmClient, axes: Any) -> None:
    wanted = np.array([0.4, 0.3, 0.5, 0.0, 0.0, 0.0, 1.0])
    found = panda.inverse_kinematics(FRAME, wanted, axes=axes)
    assert_close(poses(found.q)[:3], wanted[:3], REACHED)
    assert found.angle == 0.0


def test_what_is_not_reached_is_an_error_that_holds_the_nearest(panda: ArmClient) -> None:
    home = poses(ARM.q0)
    with pytest.raises(Refused, match=r"1 of 3 poses .* pose 1 misses") as error:
        panda.inverse_kinematics(FRAME, [home, far(home), home])
    assert isinstance(error.value, NotReached)
    assert isinstance(error.value, Unreachable)
    found = error.value.found
    assert found.reached.tolist() == [True, False, True]
    assert found.distance[1] == error.value.residual > 1.0
    assert_close(poses(found.q[[0, 2]]), [home, home], REACHED)
    miss = np.linalg.norm(poses(found.q[1])[:3] - far(home)[:3])
    assert miss == pytest.approx(found.distance[1])


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ({"frame": "paw"}, Refused, "frame 'paw' does not exist"),
        ({"pose": [0.0] * 7}, Refused, "quaternion"),
        ({"pose": [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}, Refused, "nan"),
        ({"seed": [0.0] * 6}, Refused, "seed has 6 numbers"),
        ({"axes": "up"}, Refused, "selection = 'up'"),
        ({"pose": [0.0] * 6}, InvalidInput, r"pose has shape \(6,\); expected \(7,\) or \(k, 7\)"),
        ({"pose": [[0.0], [0.0, 1.0]]}, InvalidInput, "numbers of one shape"),
        ({"axes": 3}, InvalidInput, "axes = 3; expected names"),
    ],
)
def test_bad_questions_about_poses(
    panda: ArmClient, given: dict[str, Any], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        panda.inverse_kinematics(**{"frame": FRAME, "pose": poses(ARM.q0), **given})


def test_the_command_finds_positions(arm: Typist) -> None:
    wanted = poses(ARM.q0 + 0.1)
    words = (*FIND, FRAME, "--pose")
    said = answer(arm(*words, " ".join(map(repr, wanted.tolist())), "--json"))
    assert said["joint_names"] == list(ARM.joint_names)
    assert said["reached"] is True
    assert_close(poses(said["position"]), wanted, REACHED)
    table = arm(*words, json.dumps(wanted.tolist()), "--seed", "panda_joint4=-2").output
    assert re.search(r"joint +seed \[rad\] +position \[rad\]", table)
    assert re.search(r"panda_joint4 +-2 +-[12]\.\d+", table)
    assert re.search(r"reached: yes .*\n +distance \[m\]: \S+\n +angle \[rad\]: \S+", table)


def test_the_command_shows_which_poses_are_out_of_reach(arm: Typist) -> None:
    home = poses(ARM.q0)
    given = json.dumps([home.tolist(), far(home).tolist()])
    words = (*FIND, FRAME, "--pose", given)
    shown = arm(*words)
    assert shown.exit_code == 1
    assert re.search(r"0 .* yes .*\n *1 .* no ", shown.output)
    assert "Error: 1 of 2 poses of frame 'panda_hand' cannot be reached" in shown.output
    plain = arm(*words, "--json")
    assert plain.exit_code == 1
    said = json.loads(plain.output)
    assert (said["success"], said["reached"]) == (False, [True, False])
    assert "pose 1 misses" in said["message"]
    assert_close(poses(said["position"][0]), home, REACHED)
