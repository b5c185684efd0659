# SPDX-License-Identifier: Apache-2.0
"""Random trees of skewed joints, against Pinocchio called directly."""

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import Dynamics, load_scene
from models.oracle import Oracle
from models.random_tree import random_tree
from tolerances import ALGEBRA, INVERSE_PAIR, PINOCCHIO, assert_close


@pytest.mark.parametrize("joints", [1, 2, 3, 5, 8, 13, 20, 30])
@pytest.mark.parametrize("repeat", sampled(range(3), 1))
def test_agrees_with_pinocchio(joints: int, repeat: int, rng: np.random.Generator) -> None:
    scene = load_scene(random_tree(rng, joints))
    dyn, oracle = Dynamics(scene), Oracle(scene)
    for _ in range(5):
        q, v, x = models.random_state(rng, dyn.n)
        assert_close(dyn.inverse(q, v, x), oracle.inverse(q, v, x), PINOCCHIO)
        assert_close(dyn.mass_matrix(q), oracle.mass_matrix(q), PINOCCHIO)
        assert_close(dyn.coriolis_matrix(q, v), oracle.coriolis_matrix(q, v), PINOCCHIO)
        assert_close(dyn.forward(q, v, x), oracle.forward(q, v, x), ALGEBRA)
        assert_close(dyn.inverse(q, v, dyn.forward(q, v, x)), x, INVERSE_PAIR)
