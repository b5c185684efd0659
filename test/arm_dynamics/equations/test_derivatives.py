# SPDX-License-Identifier: Apache-2.0
"""Derivatives of inverse dynamics against Pinocchio's and those that CasADi finds."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.derivatives import inverse_derivatives
from arm_dynamics.model.tree_builder import gravity_of, tree_of
from models.large import mobile
from models.random_tree import random_tree
from tolerances import ALGEBRA, assert_close


def derivatives(model: ArmModel) -> ca.Function:
    q, v, a = (ca.SX.sym(name, model.n) for name in "qva")
    found = inverse_derivatives(tree_of(model), q, v, a, gravity_of(model))
    return ca.Function("derivatives", [q, v, a], list(found))


@pytest.mark.parametrize("joints", [1, 2, 5, 13])
@pytest.mark.parametrize("repeat", range(3))
def test_of_random_trees_are_pinocchios(
    joints: int, repeat: int, rng: np.random.Generator
) -> None:
    single = random_tree(rng, joints).replace("continuous", "revolute")
    model = ArmModel(load_scene({"robot": {"urdf": single}, "joints": {"*": {"armature": 0.1}}}))
    q, v, a = rng.uniform(-1.0, 1.0, (3, model.n))
    expected = pin.computeRNEADerivatives(model.pin, model.pin.createData(), q, v, a)
    found = derivatives(model)(q, v, a)
    for ours, theirs in zip(found[:2], expected[:2], strict=True):
        assert_close(np.array(ours), theirs, ALGEBRA)
    upper = np.triu(expected[2])
    M = upper + np.triu(upper, 1).T
    has_armature = np.allclose(np.diag(found[2]), np.diag(M))
    assert_close(np.array(found[2]), M if has_armature else M + 0.1 * np.eye(model.n), ALGEBRA)


@pytest.mark.parametrize("name", ["gripper", "scara", "gantry", "two_arms", "finger"])
def test_are_those_of_the_equation(name: str, rng: np.random.Generator) -> None:
    """Followers, slides and axes along coordinates included."""
    model = ArmModel(models.scene(name))
    q, v, a = (ca.SX.sym(letter, model.n) for letter in "qva")
    tau = rigid_body.inverse(tree_of(model), q, v, a, gravity_of(model))
    expected = ca.Function("expected", [q, v, a], [ca.jacobian(tau, x) for x in (q, v, a)])
    state = rng.uniform(-1.0, 1.0, (3, model.n))
    for ours, theirs in zip(derivatives(model)(*state), expected(*state), strict=True):
        assert_close(np.array(ours), np.array(theirs), ALGEBRA)


def test_joints_on_different_branches_have_none(rng: np.random.Generator) -> None:
    model = ArmModel(load_scene(mobile(rng, 25)))
    pattern = np.array(ca.DM(derivatives(model).sparsity_out(1), 1.0))
    assert not pattern[3:10, 10:17].any() and not pattern[10:17, 3:10].any()
    assert pattern[:3].all() and pattern[:, :3].any(axis=1).all()
