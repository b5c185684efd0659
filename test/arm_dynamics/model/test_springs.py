# SPDX-License-Identifier: Apache-2.0
"""Springs in the equation of motion of any robot, against the slope of their potential."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, SceneError, Term, load_scene
from arm_dynamics.terms.evaluator import MANY
from models.random_tree import random_tree
from models.sprung import SprungOracle, sprung
from tolerances import ALGEBRA, CLOSED_FORM, INVERSE_PAIR, PINOCCHIO, SPRING, assert_close


def tree(rng: np.random.Generator, joints: int, **about: Any) -> dict[str, Any]:
    return sprung(random_tree(rng, joints), rng, **about)


@pytest.mark.parametrize(("joints", "cord"), [(1, True), (4, False), (7, True)])
def test_torque_is_tension_times_the_slope_of_the_length(
    joints: int, cord: bool, rng: np.random.Generator
) -> None:
    scene = load_scene(tree(rng, joints, cord=cord))
    dyn, oracle = Dynamics(scene), SprungOracle(scene)
    for _ in range(3):
        q, v, a = models.random_state(rng, dyn.n)
        kinetic, potential = oracle.energy(q, v)
        if not cord:
            assert_close(dyn.energy(q, v), (kinetic, potential + oracle.bent(q)), PINOCCHIO)
        assert_close(dyn.spring(q, v), oracle.spring(q, v), SPRING)
        assert_close(dyn.inverse(q, v, a), oracle.inverse(q, v, a), SPRING)
        assert_close(dyn.forward(q, v, a), oracle.forward(q, v, a), SPRING)


@pytest.mark.parametrize("joints", [3, 20])
def test_inverse_and_forward_undo_each_other(joints: int, rng: np.random.Generator) -> None:
    dyn = Dynamics(tree(rng, joints, count=5))
    q, v, x = models.random_state(rng, dyn.n)
    assert_close(dyn.inverse(q, v, dyn.forward(q, v, x)), x, INVERSE_PAIR)
    assert_close(dyn.forward(q, v, dyn.inverse(q, v, x)), x, INVERSE_PAIR)


def test_terms_add_up_and_the_old_ones_know_no_springs(rng: np.random.Generator) -> None:
    data = tree(rng, 5)
    dyn, bare = Dynamics(data), Dynamics({"robot": data["robot"]})
    q, v, a = models.random_state(rng, dyn.n)
    assert_close(sum(dyn.inverse(q, v, a, t) for t in Term), dyn.inverse(q, v, a), PINOCCHIO)
    assert_close(dyn.inverse(q, v, a, Term.SPRING), dyn.spring(q, v), PINOCCHIO)
    old = Term.ALL & ~Term.SPRING
    np.testing.assert_array_equal(dyn.inverse(q, v, a, old), bare.inverse(q, v, a))
    assert_close(bare.inverse(q, v, a, Term.SPRING), np.zeros(dyn.n), PINOCCHIO)


def test_batches_run_as_checked_code(rng: np.random.Generator) -> None:
    dyn = Dynamics(tree(rng, 4, cord=True))
    q, v, a = rng.normal(size=(3, MANY, dyn.n))
    for many, one in (
        (dyn.spring(q, v), [dyn.spring(*x) for x in zip(q, v, strict=True)]),
        (dyn.inverse(q, v, a), [dyn.inverse(*x) for x in zip(q, v, a, strict=True)]),
        (np.transpose(dyn.energy(q, v)), [dyn.energy(*x) for x in zip(q, v, strict=True)]),
    ):
        assert_close(many, np.array(one), ALGEBRA)


def test_springs_of_followers_act_through_their_leader(rng: np.random.Generator) -> None:
    scene = {
        "robot": {"urdf": models.scene("gripper").robot.urdf},
        "joints": {"cover_hinge": {"spring": {"stiffness": 2.0, "rest": 0.1, "damping": 0.5}}},
    }
    dyn = Dynamics(scene)
    q, v = 0.1 * rng.normal(size=(2, dyn.n))
    k = dyn.joint_names.index("left_slide")
    wanted = np.zeros(dyn.n)
    wanted[k] = 12.0 * (2.0 * (12.0 * q[k] + 0.4 - 0.1) + 0.5 * 12.0 * v[k])
    assert_close(dyn.spring(q, v), wanted, CLOSED_FORM)


def test_a_table_instead_of_the_stiffness_of_all() -> None:
    urdf = models.scene("planar_3r").robot.urdf
    own = {"stiffness": 0.0, "table": TABLE, "rest": 0.5}
    joints = {"*": {"spring": {"stiffness": 5.0}}, "joint2": {"spring": own}}
    dyn = Dynamics({"robot": {"urdf": urdf}, "joints": joints})
    assert_close(dyn.spring([1.0, 2.5, 3.0]), [5.0, 4.0, 15.0], CLOSED_FORM)


TABLE = {"deflection": [0.0, 1.0, 2.0], "torque": [0.0, 1.0, 4.0]}
URDF = models.scene("planar_3r").robot.urdf
HELD = {"joint3": {"spring": {"stiffness": 1.0}}}
BOTH = {"joint1": {"spring": {"stiffness": 2.0, "table": TABLE}}}
TIED = {"frames": ["link1", "joint1"], "stiffness": 1.0, "name": "idle"}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"joints": BOTH},
            "joints.joint1.spring' = .*stiffness = 2.0 and a table; one of the two",
        ),
        (
            {"robot": {"urdf": URDF, "lock": ["joint3"]}, "joints": HELD},
            "joints.joint3.*holds fast",
        ),
        ({"springs": [TIED]}, "'idle'.*link1.*joint1.*cannot move"),
    ],
)
def test_refusals(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        ArmModel(load_scene({"robot": {"urdf": URDF}} | changes))
