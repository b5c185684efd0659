# SPDX-License-Identifier: Apache-2.0
"""Elementary functions of generated code, alone and in lanes, against 60 digits of mpmath."""

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from elementwise import LANGUAGES, elementwise

LEAST, MOST = -707.0, 709.78  # exponents whose powers are computed, not set to zero or infinity


def numbers(rng: np.random.Generator) -> np.ndarray:
    """Exponents of all sizes, and those in the middle between two powers of two."""
    halves = (np.arange(-1019, 1024, 7) + 0.5) * np.log(2.0)
    sizes = 10.0 ** rng.uniform(-20.0, 0.0, 100)
    spread = [rng.uniform(-1.0, 1.0, 100), rng.uniform(-40.0, 40.0, 100)]
    everywhere = rng.uniform(LEAST, MOST, 200)
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


REDUCTION = 1e-20  # error of what is left of an argument when quarter turns are taken off


def both(language: str) -> Callable[[np.ndarray], np.ndarray]:
    """What gives sine and cosine, shape (2, k), of k angles, by the code in that language."""
    sine, cosine = (elementwise(language, name) for name in ("sin", "cos"))
    return lambda x: np.array([sine(x), cosine(x)])


def near_quarter_turns() -> np.ndarray:
    """The angles nearest to multiples of π/2, where one of the two is all but zero."""
    turns = np.r_[1:65, 2 ** np.arange(6, 20), 3 ** np.arange(4, 13), 636_500:636_600]
    with mpmath.workdps(60):
        nearest = [float(int(k) * mpmath.pi / 2) for k in turns]
    return np.array(nearest)


def angles(rng: np.random.Generator) -> dict[str, np.ndarray]:
    quarters = near_quarter_turns()
    return {
        "small": np.r_[0.0, 10.0 ** np.arange(-300, 0, 13.0), 10.0 ** np.linspace(-8, 0, 256)],
        "a few turns": rng.uniform(-20.0, 20.0, 200),
        "many turns": rng.uniform(-1e6, 1e6, 200),
        "near quarter turns": np.r_[quarters, quarters * (1.0 - 2.0**-52), 1e6, -1e6],
        "far out": 10.0 ** rng.uniform(6.0, 15.0, 100) * rng.choice([-1.0, 1.0], 100),
    }


def share(found: np.ndarray, wanted: list[mpmath.mpf]) -> float:
    """Largest difference as a part of what is allowed: a unit of the last place, ``REDUCTION``."""
    pairs = zip(found.tolist(), wanted, strict=True)
    return max(
        float(abs(y - exact)) / (np.spacing(abs(float(exact))) + REDUCTION) for y, exact in pairs
    )


@pytest.mark.parametrize("language", LANGUAGES)
def test_sine_and_cosine_within_one_unit_of_the_last_place(
    language: str, rng: np.random.Generator
) -> None:
    values = both(language)
    for name, x in angles(rng).items():
        sine, cosine = values(x)
        with mpmath.workdps(60):
            exact = [mpmath.mpf(value) for value in x.tolist()]
            assert share(sine, [mpmath.sin(value) for value in exact]) < 1.0, name
            assert share(cosine, [mpmath.cos(value) for value in exact]) < 1.0, name


def test_lanes_give_the_same_bits_of_both(rng: np.random.Generator) -> None:
    """Also where some lanes of a vector are out of range or NaN."""
    alone, lanes = map(both, LANGUAGES)
    x = rng.permutation(np.concatenate([*angles(rng).values(), [np.nan, np.inf, -np.inf, -0.0]]))
    np.testing.assert_array_equal(alone(x).view(np.int64), lanes(x).view(np.int64))


def test_what_is_no_number_stays_none() -> None:
    for language in LANGUAGES:
        assert np.isnan(both(language)(np.array([np.nan, np.inf, -np.inf, np.nan]))).all()
