# SPDX-License-Identifier: Apache-2.0
"""Several numbers in a vector, as in rollouts: whether one of them is out of range."""

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
OF_TWO = {
    "x + y": np.add, "x - y": np.subtract, "x * y": np.multiply, "x / y": np.divide,
    "x < y": np.less, "x <= y": np.less_equal, "x == y": np.equal, "x != y": np.not_equal,
    "x && y": np.logical_and, "x || y": np.logical_or, "fmin(x, y)": np.minimum,
    "fmax(x, y)": np.maximum, "if_else_zero(x, y)": lambda x, y: np.where(x, y, 0.0),
}  # fmt: skip
OF_ONE = {
    "-x": np.negative, "!x": np.logical_not, "sign(x)": np.sign, "floor(x)": np.floor,
    "fabs(x)": np.abs, "sqrt(fabs(x))": lambda x: np.sqrt(abs(x)),
}  # fmt: skip
EVERY = [*OF_TWO, *OF_ONE]
OPERATIONS = f"""
#define LANES {LANES}
#include "lanes.hpp"
extern "C" __attribute__((visibility("default")))
void all_of(const double* given_x, const double* given_y, double* results) {{
  real x, y;
  for (int k = 0; k < LANES; ++k) LANE(x, k) = given_x[k], LANE(y, k) = given_y[k];
  const real found[] = {{{", ".join(EVERY)}}};
  for (int i = 0; i < {len(EVERY)}; ++i)
    for (int k = 0; k < LANES; ++k) results[i * LANES + k] = LANE(found[i], k);
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


def test_one_beyond_the_limit_in_any_lane_is_enough_and_no_number_is_one(beyond: Beyond) -> None:
    most = np.nextafter(2.0, 3.0)
    for other in (0.0, 2.0, -2.0):
        assert not beyond([other] * LANES)
        for x in (most, -most, 1e300, np.inf, -np.inf, np.nan):
            for lane in range(LANES):
                numbers = [other] * LANES
                numbers[lane] = x
                assert beyond(numbers)


def test_every_operation_is_that_of_numbers_in_each_lane() -> None:
    """Also where both are equal, and of either sign."""
    if compiler.find_compiler("c++") is None:
        pytest.skip("no compiler of c++")
    run = compiler.build(OPERATIONS, "c++").library.all_of
    run.argtypes, run.restype = [ctypes.c_void_p] * 3, None
    values = np.array([-2.5, -1.0, -0.0, 0.0, 1.0, 2.5])
    x, y = np.array(np.meshgrid(values, values)).reshape(2, -1, LANES)
    found = np.empty((len(x), len(EVERY), LANES))
    for a, b, results in zip(x, y, found, strict=True):
        run(a.ctypes.data, b.ctypes.data, results.ctypes.data)
    with np.errstate(divide="ignore", invalid="ignore"):
        wanted = [made(x, y) for made in OF_TWO.values()] + [made(x) for made in OF_ONE.values()]
    for i, name in enumerate(EVERY):
        np.testing.assert_array_equal(found[:, i], np.asarray(wanted[i], float), name)
