# SPDX-License-Identifier: Apache-2.0
"""Articulated bodies some of whose joints have given accelerations, against inverse dynamics."""

import casadi as ca
import numpy as np
import pytest

from arm_dynamics import ArmModel, Dynamics, load_scene
from arm_dynamics.equations.forward_dynamics import hybrid
from arm_dynamics.model.tree_builder import gravity_of, tree_of
from models.random_tree import random_tree
from tolerances import INVERSE_PAIR, assert_close


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
