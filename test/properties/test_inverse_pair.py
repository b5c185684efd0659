# SPDX-License-Identifier: Apache-2.0
"""Inverse and forward dynamics are inverses, at a thousand random states of each robot."""

import numpy as np
import pytest
from samples import sampled

import models
from tolerances import INVERSE_PAIR, assert_close

STATES = 1000
EACH = sampled(models.ROBOTS, 6)


@pytest.mark.parametrize("robot", EACH)
def test_inverse_of_forward(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    q = rng.uniform(-np.pi, np.pi, (STATES, dyn.n))
    v, tau = rng.normal(0, 2, (STATES, dyn.n)), rng.normal(0, 10, (STATES, dyn.n))
    assert_close(dyn.inverse(q, v, dyn.forward(q, v, tau)), tau, INVERSE_PAIR)


@pytest.mark.parametrize("robot", EACH)
def test_forward_of_inverse(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    q = rng.uniform(-np.pi, np.pi, (STATES, dyn.n))
    v, a = rng.normal(0, 2, (STATES, dyn.n)), rng.normal(0, 10, (STATES, dyn.n))
    assert_close(dyn.forward(q, v, dyn.inverse(q, v, a)), a, INVERSE_PAIR)
