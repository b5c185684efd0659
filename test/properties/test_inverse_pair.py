# SPDX-License-Identifier: Apache-2.0
"""Inverse and forward dynamics are inverses, at a thousand random states of each robot."""

import numpy as np
import pytest
from samples import sampled

import models
from tolerances import INVERSE_PAIR, assert_close

STATES = 1000


@pytest.mark.parametrize("robot", sampled(models.ROBOTS, 6))
def test_each_undoes_the_other(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    q = rng.uniform(-np.pi, np.pi, (STATES, dyn.n))
    v = rng.normal(0, 2, (STATES, dyn.n))
    tau, a = rng.normal(0, 10, (2, STATES, dyn.n))
    assert_close(dyn.inverse(q, v, dyn.forward(q, v, tau)), tau, INVERSE_PAIR)
    assert_close(dyn.forward(q, v, dyn.inverse(q, v, a)), a, INVERSE_PAIR)
