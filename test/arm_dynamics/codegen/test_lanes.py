# SPDX-License-Identifier: Apache-2.0
"""Several numbers in a vector, as in rollouts: whether one of them is out of range."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from arm_dynamics.codegen import compiler

LANES = 4
SOURCE = f"""
#define LANES {LANES}
#include "lanes.hpp"
extern "C" __attribute__((visibility("default")))
int any_beyond(const double* x, double limit) {{
  real a = 0.0;
  for (int k = 0; k < LANES; ++k) LANE(a, k) = x[k];
  return BEYOND(a, limit);
}}
"""
Beyond = Callable[[list[float]], bool]
LIMIT = 2.0


@pytest.fixture(scope="module")
def beyond() -> Beyond:
    """Whether one of four numbers is beyond the limit."""
    if compiler.find_compiler("c++") is None:
        pytest.skip("no compiler of c++")
    run = compiler.build(SOURCE, "c++").library.any_beyond
    run.argtypes = [ctypes.c_void_p, ctypes.c_double]
    return lambda x: bool(run(np.array(x, float).ctypes.data, LIMIT))


@pytest.mark.parametrize("x", [[0.0] * 4, [1.0, -1.0, 0.5, -0.0], [2.0] * 4, [-2.0] * 4])
def test_up_to_the_limit_none_is_beyond(beyond: Beyond, x: list[float]) -> None:
    assert not beyond(x)


@pytest.mark.parametrize("lane", range(LANES))
@pytest.mark.parametrize("other", [0.0, 2.0, -2.0])
@pytest.mark.parametrize(
    "x", [np.nextafter(2.0, 3.0), -np.nextafter(2.0, 3.0), 1e300, np.inf, -np.inf, np.nan]
)
def test_one_in_any_lane_is_enough_and_no_number_is_one(
    beyond: Beyond, x: float, other: float, lane: int
) -> None:
    numbers = [other] * LANES
    numbers[lane] = x
    assert beyond(numbers)


def test_so_are_all_of_them(beyond: Beyond) -> None:
    assert beyond([3.0, -3.0, np.inf, np.nan])
