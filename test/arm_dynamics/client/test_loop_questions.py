# SPDX-License-Identifier: Apache-2.0
"""Constrained dynamics through the client and ``./arm call``."""

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
from arm_dynamics import InvalidInput
from arm_dynamics.client import ArmClient
from arm_dynamics.exceptions import Refused
from arm_dynamics.ros.interfaces import MAX_TERMS_POINTS
from arm_dynamics.task_space import TaskSpace
from tolerances import FINITE_DIFF, INVERSE_PAIR, PINOCCHIO, assert_close

pytestmark = pytest.mark.ros

SCENES = {"loop": "four_bar", "open": "two_link"}  # by namespace
LOOP, OPEN = "loop/dynamics", "open/dynamics"
FOUR_BAR, TWO_LINK = models.dynamics("four_bar"), models.dynamics("two_link")
Q0, V0 = FOUR_BAR.model.q0, 0.1 * FOUR_BAR.model.v0


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[int]:
    """A domain with a dynamics node that knows a closed chain, and one that knows an open one."""
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


@pytest.fixture
def arm(domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Typist:
    """Runs a command in the domain of the nodes."""
    return Typist(domain, monkeypatch, capfd)


def gap(q: np.ndarray) -> np.ndarray:
    """Where the loop was cut: from the rocker's end to the coupler's, in the rocker's axes [m]."""
    rocker, coupler = (TaskSpace(FOUR_BAR, frame).pose(q) for frame in ("rocker", "coupler"))
    end = coupler.position + coupler.rotation @ [0.3, 0.0, 0.0]
    return rocker.rotation.T @ (end - rocker.position) - [0.25, 0.0, 0.0]


def test_accelerations_keep_the_loop_closed(loop: ArmClient, rng: np.random.Generator) -> None:
    tau = rng.normal(size=3)
    found = loop.constrained_dynamics(Q0, V0, tau)
    assert found.joint_names == FOUR_BAR.joint_names
    assert found.constraint_names == ("loop",) * 3
    a, h = found.acceleration, 1e-4
    along = [gap(Q0 + V0 * t + 0.5 * a * t**2) for t in (-h, 0.0, h)]
    scale = np.abs(a).max()
    assert_close((along[0] - 2.0 * along[1] + along[2]) / h**2 / scale, np.zeros(3), FINITE_DIFF)
    lacking = tau - FOUR_BAR.inverse(Q0, V0, a)
    assert np.abs(lacking).max() > 0.01  # without the loop's forces it would move otherwise


def test_they_agree_with_the_core(loop: ArmClient, rng: np.random.Generator) -> None:
    q, v = np.tile(Q0, (4, 1)), np.outer([1.0, 0.5, 0.0, -1.0], V0)
    tau = rng.normal(size=(4, 3))
    a, lam = FOUR_BAR.constrained_forward(q, v, tau)
    found = loop.constrained_dynamics(q, v, tau)
    assert_close(found.acceleration, a, PINOCCHIO)
    assert_close(found.multipliers, lam, PINOCCHIO)
    still = loop.constrained_dynamics(Q0)
    wanted = FOUR_BAR.constrained_forward(Q0, np.zeros(3), np.zeros(3))
    assert_close(still.acceleration, wanted[0], PINOCCHIO)
    assert_close(still.multipliers, wanted[1], PINOCCHIO)


def test_there_and_back_in_any_order(loop: ArmClient, rng: np.random.Generator) -> None:
    """Torques of a motion with its forces are those that made it: the loop bears the rest."""
    order, tau = [2, 0, 1], rng.normal(size=(2, 3))
    names = [FOUR_BAR.joint_names[i] for i in order]
    q, v = np.tile(Q0[order], (2, 1)), np.array([V0[order], -V0[order]])
    found = loop.constrained_dynamics(q, v, tau, names)
    assert found.joint_names == tuple(names)
    assert found.multipliers.shape == (2, 3)
    back = loop.constrained_inverse_dynamics(q, v, found.acceleration, found.multipliers, names)
    assert_close(back, tau, INVERSE_PAIR)
    alone = loop.constrained_inverse_dynamics(q[0], v[0], found.acceleration[0], None, names)
    tree = loop.inverse_dynamics(q[0], v[0], found.acceleration[0], joint_names=names)
    assert_close(alone, tree, PINOCCHIO)


def test_without_constraints_the_tree_moves(domain: int) -> None:
    q = [[0.3, -0.7], [0.0, 1.0]]
    with ArmClient(OPEN, timeout=20.0, domain=domain) as client:
        found = client.constrained_dynamics(q)
    assert found.multipliers.shape == (2, 0)
    zero = np.zeros((2, 2))
    assert_close(found.acceleration, TWO_LINK.forward(q, zero, zero), INVERSE_PAIR)


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ({"multipliers": [1.0]}, Refused, "multipliers has 1 numbers; allowed: 3"),
        ({"multipliers": [0.0, 0.0, np.inf]}, Refused, "not finite"),
        ({"a": [0.0, 0.0]}, Refused, "acceleration has 2 numbers; allowed: 0 or 3"),
        ({"q": np.zeros((MAX_TERMS_POINTS + 1, 3))}, Refused, f"up to {MAX_TERMS_POINTS}"),
        ({"multipliers": "much"}, InvalidInput, "multipliers = 'much'; expected real numbers"),
    ],
)
def test_bad_questions_about_the_loop(
    loop: ArmClient, given: dict[str, Any], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        loop.constrained_inverse_dynamics(**{"q": Q0, **given})


def test_the_command_shows_motion_and_forces(arm: Typist) -> None:
    tau = [0.1, -0.2, 0.3]
    a, lam = FOUR_BAR.constrained_forward(Q0, np.zeros(3), tau)
    given = ("--position", json.dumps(Q0.tolist()))
    words = ("constrained-dynamics", "--node", LOOP, *given, "--effort", "0.1 -0.2 0.3")
    said = answer(arm(*words, "--json"))
    assert said["constraint_names"] == ["loop"] * 3
    assert_close(said["acceleration"], a, PINOCCHIO)
    assert_close(said["multipliers"], lam, PINOCCHIO)
    shown = arm(*words).output
    assert re.search(r"effort \[N m\] +acceleration \[rad/s²\]", shown)
    assert re.search(rf"knee +\S+ +-0\.2 +{re.escape(f'{a[1]:.6g}')} ", shown)
    assert re.search(rf"loop 1 +{re.escape(f'{lam[0]:.6g}')} ", shown)
    assert "multipliers [N, N m]" in shown


def test_the_command_answers_torques(arm: Typist) -> None:
    """At two points: to push the rocker's end with the coupler's, and to stay without."""
    given = ("--position", json.dumps([Q0.tolist()] * 2), "--inverse")
    words = ("constrained-dynamics", "--node", LOOP, *given, "--multipliers", "[[1,5,2],[0,0,0]]")
    said = answer(arm(*words, "--json"))
    push, stay = np.array(said["effort"])
    assert_close(stay, FOUR_BAR.gravity(Q0), PINOCCHIO)
    steps = 1e-6 * np.eye(3)
    work = [(gap(Q0 + step) - gap(Q0 - step)) @ [1.0, 5.0, 2.0] / 2e-6 for step in steps]
    assert_close(push - stay, work, FINITE_DIFF)
    assert np.abs(work).max() > 0.1
    assert "point: effort [N m]" in arm(*words).output
