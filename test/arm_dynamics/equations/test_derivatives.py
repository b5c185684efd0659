# SPDX-License-Identifier: Apache-2.0
"""Derivatives of inverse dynamics against Pinocchio's and those that CasADi finds."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from samples import sampled

import models
from arm_dynamics import ArmModel, Dynamics, load_scene
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.derivatives import IN_LINKS_AT_MOST, inverse_derivatives
from arm_dynamics.equations.forward_dynamics import hybrid
from arm_dynamics.model.tree_builder import gravity_of, tree_of
from models.random_tree import random_tree, tree
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close


def derivatives(model: ArmModel) -> ca.Function:
    q, v, a = (ca.SX.sym(name, model.n) for name in "qva")
    found = inverse_derivatives(tree_of(model), q, v, a, gravity_of(model))
    return ca.Function("derivatives", [q, v, a], list(found))


@pytest.mark.parametrize("joints", [1, 2, 5, 13, IN_LINKS_AT_MOST + 1])
@pytest.mark.parametrize("repeat", sampled(range(3), 1))
def test_of_random_trees_are_pinocchios(
    joints: int, repeat: int, rng: np.random.Generator
) -> None:
    parents = [int(rng.integers(max(0, i - 2), i + 1)) for i in range(joints)]
    urdf = tree(rng, parents, rng.choice(["revolute", "prismatic"], joints).tolist())
    model = ArmModel(load_scene({"robot": {"urdf": urdf}, "joints": {"*": {"armature": 0.1}}}))
    q, v, a = rng.uniform(-1.0, 1.0, (3, model.n))
    data = model.pin.createData()
    by_q, by_v, _ = pin.computeRNEADerivatives(model.pin, data, q, v, a)
    M = Dynamics(model).mass_matrix(q)
    for ours, theirs in zip(derivatives(model)(q, v, a), (by_q, by_v, M), strict=True):
        assert_close(np.array(ours), theirs, ALGEBRA)


@pytest.mark.parametrize("name", ["gripper", "scara", "gantry", "two_arms", "finger"])
def test_are_those_of_the_equation(name: str, rng: np.random.Generator) -> None:
    """Followers, slides and axes along coordinates included."""
    model = ArmModel(models.scene(name))
    q, v, a = (ca.SX.sym(letter, model.n) for letter in "qva")
    tau = rigid_body.inverse_dynamics(tree_of(model), q, v, a, gravity_of(model))
    expected = ca.Function("expected", [q, v, a], [ca.jacobian(tau, x) for x in (q, v, a)])
    state = rng.uniform(-1.0, 1.0, (3, model.n))
    for ours, theirs in zip(derivatives(model)(*state), expected(*state), strict=True):
        assert_close(np.array(ours), np.array(theirs), ALGEBRA)


@pytest.mark.parametrize("joints", [1, 2, 5, 20])
@pytest.mark.parametrize("part", [0.0, 0.3, 1.0])
def test_given_accelerations_take_the_torques_that_are_missing(
    joints: int, part: float, rng: np.random.Generator
) -> None:
    scene = {"robot": {"urdf": random_tree(rng, joints)}, "joints": {"*": {"armature": 0.1}}}
    model = ArmModel(load_scene(scene))
    symbols = [ca.SX.sym(name, model.n) for name in ("q", "v", "tau", "free", "given")]
    q, v, tau, *chosen = symbols
    law = hybrid(tree_of(model), q, v, tau, gravity_of(model), *chosen)
    free = (rng.uniform(size=model.n) >= part).astype(float)
    state, given = rng.uniform(-1.0, 1.0, (3, model.n)), (1.0 - free) * rng.normal(size=model.n)
    numbers = ca.Function("law", symbols, list(law))(*state, free, given)
    a, taken = (np.array(x).ravel() for x in numbers)
    np.testing.assert_array_equal(a[free == 0.0], given[free == 0.0])
    np.testing.assert_array_equal(taken[free == 1.0], 0.0)
    assert_close(Dynamics(model).inverse(state[0], state[1], a), state[2] - taken, INVERSE_PAIR)
