# SPDX-License-Identifier: Apache-2.0
"""Batches give row by row the results of single calls."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics
from models.asked import CALLS as EVERY

ROBOTS = ("panda", "kinova", "gripper", "gantry")
Call = Callable[[Dynamics, np.ndarray, np.ndarray, np.ndarray], np.ndarray]

CALLS = EVERY | {"inverse without friction": lambda d, q, v, x: d.inverse(q, v, x, terms=7)}


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("rows", [1, 5])
def test_rows_equal_single_calls(
    name: str, call: Call, rows: int, rng: np.random.Generator
) -> None:
    dyn = models.dynamics(name)
    batch = [
        np.array(x)
        for x in zip(*(models.random_state(rng, dyn.n) for _ in range(rows)), strict=True)
    ]
    together = call(dyn, *batch)
    alone = np.array([call(dyn, *row) for row in zip(*batch, strict=True)])
    np.testing.assert_array_equal(together, alone)


def test_a_single_vector_serves_every_row(rng: np.random.Generator) -> None:
    dyn = models.dynamics("two_link")
    q = rng.uniform(-1, 1, (4, 2))
    at_rest = dyn.inverse(q, np.zeros(2), np.zeros(2))
    np.testing.assert_array_equal(at_rest, dyn.gravity(q))
