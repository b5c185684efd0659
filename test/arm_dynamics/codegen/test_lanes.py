# SPDX-License-Identifier: Apache-2.0
"""Operations of generated code in the lanes of a vector, and its elementary functions."""

import ctypes
from itertools import product

import mpmath
import numpy as np
import pytest
from elementwise import LANGUAGES, elementwise

from arm_dynamics.codegen import compiler

LANES = 4

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
SOURCE = f"""
#define LANES {LANES}
#include "lanes.hpp"
#define EXPORT extern "C" __attribute__((visibility("default")))
EXPORT int any_beyond(const double* x, double limit) {{
  real a = 0.0;
  for (int k = 0; k < LANES; ++k) LANE(a, k) = x[k];
  return BEYOND(a, limit);
}}
EXPORT void all_of(const double* given_x, const double* given_y, double* results) {{
  real x, y;
  for (int k = 0; k < LANES; ++k) LANE(x, k) = given_x[k], LANE(y, k) = given_y[k];
  const real found[] = {{{", ".join(EVERY)}}};
  for (int i = 0; i < {len(EVERY)}; ++i)
    for (int k = 0; k < LANES; ++k) results[i * LANES + k] = LANE(found[i], k);
}}
"""


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    if compiler.find_compiler("c++") is None:
        pytest.skip("no compiler of c++")
    return compiler.build(SOURCE, "c++").library


def test_one_beyond_the_limit_in_any_lane_is_enough_and_no_number_is_one(
    library: ctypes.CDLL,
) -> None:
    beyond, most = library.any_beyond, np.nextafter(2.0, 3.0)
    beyond.argtypes = [ctypes.c_void_p, ctypes.c_double]
    for other in (0.0, 2.0, -2.0):
        numbers = np.full(LANES, other)
        assert not beyond(numbers.ctypes.data, 2.0)
        for x, lane in product((most, -most, 1e300, np.inf, -np.inf, np.nan), range(LANES)):
            numbers[:] = other
            numbers[lane] = x
            assert beyond(numbers.ctypes.data, 2.0)


def test_every_operation_is_that_of_numbers_in_each_lane(library: ctypes.CDLL) -> None:
    """Also where both are equal, and of either sign."""
    run = library.all_of
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


LEAST, MOST = -707.0, 709.78  # exponents whose powers are computed, not set to zero or infinity


def exponents(rng: np.random.Generator) -> np.ndarray:
    """Exponents of all sizes, and those in the middle between two powers of two."""
    halves = (np.arange(-1019, 1024, 7) + 0.5) * np.log(2.0)
    sizes = 10.0 ** rng.uniform(-20.0, 0.0, 100)
    spread = [rng.uniform(-1.0, 1.0, 100), rng.uniform(-40.0, 40.0, 100)]
    everywhere = rng.uniform(LEAST, MOST, 200)
    edges = [0.0, -0.0, LEAST, MOST]
    return np.concatenate([halves[halves < MOST], sizes, -sizes, *spread, everywhere, edges])


def near_quarter_turns() -> np.ndarray:
    """The angles nearest to multiples of π/2, where one of the two is all but zero."""
    turns = np.r_[1:65, 2 ** np.arange(6, 20), 3 ** np.arange(4, 13), 636_500:636_600]
    with mpmath.workdps(60):
        nearest = [float(int(k) * mpmath.pi / 2) for k in turns]
    return np.array(nearest)


def angles(rng: np.random.Generator) -> np.ndarray:
    """Small angles, a few turns, many, and so many that the range of the reduction is left."""
    quarters = near_quarter_turns()
    small = np.r_[0.0, 10.0 ** np.arange(-300, 0, 13.0), 10.0 ** np.linspace(-8, 0, 256)]
    turns = [rng.uniform(-most, most, 200) for most in (20.0, 1e6)]
    far = 10.0 ** rng.uniform(6.0, 15.0, 100) * rng.choice([-1.0, 1.0], 100)
    return np.concatenate([small, *turns, quarters, quarters * (1.0 - 2.0**-52), far])


# Of each function its arguments, and what may be lost when quarter turns are taken off.
FUNCTIONS = {"exp": (exponents, 0.0), "sin": (angles, 1e-20), "cos": (angles, 1e-20)}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_within_one_unit_of_the_last_place(name: str, rng: np.random.Generator) -> None:
    arguments, reduction = FUNCTIONS[name]
    x = arguments(rng)
    found = elementwise("c", name)(x)
    with mpmath.workdps(60):
        exact = [getattr(mpmath, name)(value) for value in x.tolist()]
        errors = [float(abs(y - z)) for y, z in zip(found.tolist(), exact, strict=True)]
    unit = np.spacing(abs(np.array(exact, float))) + reduction
    assert (errors / unit).max() < 1.0


@pytest.mark.parametrize("name", FUNCTIONS)
def test_lanes_give_the_same_bits(name: str, rng: np.random.Generator) -> None:
    """Also next to lanes that overflow, or hold no number."""
    others = [np.nan, np.inf, -np.inf, 1e4, -1e4, -0.0]
    x = rng.permutation(np.concatenate([FUNCTIONS[name][0](rng), others]))
    alone, lanes = (elementwise(language, name)(x) for language in LANGUAGES)
    np.testing.assert_array_equal(alone.view(np.int64), lanes.view(np.int64))


def test_beyond_the_range_of_numbers() -> None:
    x = np.array([-707.1, -708.0, -745.0, -1e300, -np.inf, 709.79, 711.0, 1e300, np.inf, np.nan])
    expected = [0.0] * 5 + [np.inf] * 4 + [np.nan]
    np.testing.assert_array_equal(elementwise("c", "exp")(x), expected)
    for name in ("sin", "cos"):
        assert np.isnan(elementwise("c", name)(np.array([np.nan, np.inf, -np.inf]))).all()
