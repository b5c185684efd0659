# SPDX-License-Identifier: Apache-2.0
"""Constrained dynamics and inverse kinematics through the client and ``./arm call``."""

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
from arm_dynamics.ros.interfaces import MAX_TERMS_POINTS
from arm_dynamics.task_space import InverseKinematics, TaskSpace, quaternions
from tolerances import INVERSE_PAIR, PINOCCHIO, assert_close

pytestmark = pytest.mark.ros

SCENES = {"loop": "four_bar", "hand": "panda"}  # by namespace
LOOP, FOUR_BAR = "loop/dynamics", models.dynamics("four_bar")
Q0, V0 = FOUR_BAR.model.q0, 0.1 * FOUR_BAR.model.v0
FRAME = "panda_hand"
FIND = ("inverse-kinematics", "--node", "hand/dynamics", "--frame", FRAME, "--pose")
HAND = TaskSpace(models.dynamics("panda"), FRAME)
ARM = models.dynamics("panda").model
REACHED = 2e-9  # [m], [rad]; the search promises half of it


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[int]:
    """A domain with dynamics nodes that know a closed chain and the Panda."""
    commands = [
        ("dynamics", str(models.SCENES / f"{name}.yaml"), "--ros-args", "-r", f"__ns:=/{space}")
        for space, name in SCENES.items()
    ]
    with running(forge, tmp_path_factory.mktemp("log"), *commands) as number:
        yield number


@pytest.fixture(scope="module")
def loop(domain: int) -> Iterator[ArmClient]:
    """A client of the node with the closed chain."""
    with ArmClient(LOOP, timeout=20.0, domain=domain) as client:
        yield client


@pytest.fixture(scope="module")
def panda(domain: int) -> Iterator[ArmClient]:
    """A client of the node with the Panda."""
    with ArmClient("hand/dynamics", timeout=20.0, domain=domain) as client:
        yield client


def poses(q: Any) -> np.ndarray:
    """Forward kinematics: (7,) for (7,), (k, 7) for (k, 7).

    Of q and -q, which are one rotation, that whose largest component is positive.
    """
    pose = HAND.pose(np.asarray(q))
    turn = quaternions(pose.rotation)
    largest = np.take_along_axis(turn, np.abs(turn).argmax(axis=-1, keepdims=True), axis=-1)
    return np.concatenate([pose.position, np.sign(largest) * turn], axis=-1)


def far(pose: np.ndarray) -> np.ndarray:
    return pose + [3.0, 0, 0, 0, 0, 0, 0]


def test_there_and_back_in_any_order(loop: ArmClient, rng: np.random.Generator) -> None:
    """Torques of a motion with its forces are those that made it: the loop bears the rest."""
    order, tau = [2, 0, 1], rng.normal(size=(2, 3))
    names = [FOUR_BAR.joint_names[i] for i in order]
    q, v = np.tile(Q0[order], (2, 1)), np.array([V0[order], -V0[order]])
    found = loop.constrained_dynamics(q, v, tau, names)
    assert found.joint_names == tuple(names)
    assert found.constraint_names == ("loop",) * 3
    assert found.multipliers.shape == (2, 3)
    back = loop.constrained_inverse_dynamics(q, v, found.acceleration, found.multipliers, names)
    assert_close(back, tau, INVERSE_PAIR)
    alone = loop.constrained_inverse_dynamics(q[0], v[0], found.acceleration[0], None, names)
    tree = loop.inverse_dynamics(q[0], v[0], found.acceleration[0], joint_names=names)
    assert_close(alone, tree, PINOCCHIO)
    assert np.abs(tau[0] - alone).max() > 0.01  # without the loop it would move otherwise


def test_bad_questions_are_refused(loop: ArmClient, panda: ArmClient) -> None:
    home = poses(ARM.q0)
    about_loop, about_poses = loop.constrained_inverse_dynamics, panda.inverse_kinematics
    for ask, given, error, said in (
        (about_loop, {"q": Q0, "multipliers": [0.0, 0.0, np.inf]}, Refused, "not finite"),
        (about_loop, {"q": np.zeros((MAX_TERMS_POINTS + 1, 3))}, Refused, "up to"),
        (about_poses, {"frame": "paw", "pose": home}, Refused, "frame 'paw' does not exist"),
        (about_poses, {"frame": FRAME, "pose": [0.0] * 6}, InvalidInput, r"pose has shape \(6,\)"),
        (about_poses, {"frame": FRAME, "pose": home, "axes": 3}, InvalidInput, "axes = 3"),
    ):
        with pytest.raises(error, match=said):
            ask(**given)


def test_the_command_shows_motion_and_forces(arm: Typist) -> None:
    tau = [0.1, -0.2, 0.3]
    a, lam = FOUR_BAR.constrained_forward(Q0, np.zeros(3), tau)
    words = ("constrained-dynamics", "--node", LOOP, "--position")
    ahead = (*words, json.dumps(Q0.tolist()), "--effort", "0.1 -0.2 0.3")
    said = answer(arm(*ahead, "--json"))
    assert said["constraint_names"] == ["loop"] * 3
    assert_close(said["acceleration"], a, PINOCCHIO)
    assert_close(said["multipliers"], lam, PINOCCHIO)
    shown = arm(*ahead).output
    assert re.search(rf"loop 1 +{re.escape(f'{lam[0]:.6g}')} ", shown)
    back = (*words, json.dumps(Q0.tolist()), "--inverse", "--multipliers", "0 0 0", "--json")
    assert_close(answer(arm(*back))["effort"], FOUR_BAR.gravity(Q0), PINOCCHIO)


def test_positions_found_bring_the_frame_to_the_pose(
    panda: ArmClient, rng: np.random.Generator
) -> None:
    q = ARM.q0 + rng.uniform(-0.2, 0.2, 7)
    wanted = poses(q)
    found = panda.inverse_kinematics(FRAME, wanted, ARM.q0)
    assert found.joint_names == ARM.joint_names
    assert found.reached.shape == found.distance.shape == found.angle.shape == ()
    assert_close(found.q, InverseKinematics(HAND).solve(HAND.pose(q)).q, 1e-6)


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


def test_the_command_finds_positions_and_shows_which_poses_are_out_of_reach(arm: Typist) -> None:
    wanted = poses(ARM.q0 + 0.1)
    given = json.dumps([wanted.tolist(), far(wanted).tolist()])
    shown = arm(*FIND, given)
    assert shown.exit_code == 1
    assert re.search(r"0 .* yes .*\n *1 .* no ", shown.output)
    assert "error: 1 of 2 poses of frame 'panda_hand' cannot be reached" in shown.output
    plain = arm(*FIND, given, "--json")
    assert plain.exit_code == 1
    said = json.loads(plain.output)
    assert (said["success"], said["reached"]) == (False, [True, False])
    assert_close(poses(said["position"][0]), wanted, REACHED)
