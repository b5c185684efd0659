# SPDX-License-Identifier: Apache-2.0
"""The exponential function of generated code, alone and in lanes, against 60 digits of mpmath."""

import mpmath
import numpy as np
import pytest
from elementwise import LANGUAGES, elementwise

LEAST, MOST = -707.0, 709.78  # exponents whose powers are computed, not set to zero or infinity


def numbers(rng: np.random.Generator) -> np.ndarray:
    """Exponents of all sizes, and those in the middle between two powers of two."""
    halves = (np.arange(-1019, 1024) + 0.5) * np.log(2.0)
    sizes = 10.0 ** rng.uniform(-20.0, 0.0, 400)
    spread = [rng.uniform(-1.0, 1.0, 400), rng.uniform(-40.0, 40.0, 400)]
    everywhere = rng.uniform(LEAST, MOST, 800)
    edges = [0.0, -0.0, LEAST, MOST]
    return np.concatenate([halves[halves < MOST], sizes, -sizes, *spread, everywhere, edges])


@pytest.mark.parametrize("language", LANGUAGES)
def test_within_one_unit_of_the_last_place(language: str, rng: np.random.Generator) -> None:
    x = numbers(rng)
    with mpmath.workdps(60):
        pairs = zip(elementwise(language, "exp")(x).tolist(), x.tolist(), strict=True)
        errors = [float(abs(y - mpmath.exp(exponent))) / np.spacing(y) for y, exponent in pairs]
    assert max(errors) < 1.0


@pytest.mark.parametrize("language", LANGUAGES)
def test_beyond_the_range_of_numbers(language: str) -> None:
    x = np.array([-707.1, -708.0, -745.0, -1e300, -np.inf, 709.79, 711.0, 1e300, np.inf, np.nan])
    expected = [0.0] * 5 + [np.inf] * 4 + [np.nan]
    np.testing.assert_array_equal(elementwise(language, "exp")(x), expected)


def test_lanes_give_the_same_bits(rng: np.random.Generator) -> None:
    """Also next to lanes that overflow, or hold no number."""
    x = rng.permutation(np.concatenate([numbers(rng), [np.nan, np.inf, -np.inf, 1e4, -1e4]]))
    alone, lanes = (elementwise(language, "exp")(x) for language in LANGUAGES)
    np.testing.assert_array_equal(alone.view(np.int64), lanes.view(np.int64))
