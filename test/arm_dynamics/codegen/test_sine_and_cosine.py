# SPDX-License-Identifier: Apache-2.0
"""Sine and cosine of generated code, alone and in lanes, against 60 digits of mpmath."""

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from elementwise import LANGUAGES, elementwise

REDUCTION = 1e-20  # error of what is left of an argument when quarter turns are taken off


def both(language: str) -> Callable[[np.ndarray], np.ndarray]:
    """What gives sine and cosine, shape (2, k), of k numbers, by the code in that language."""
    sine, cosine = (elementwise(language, name) for name in ("sin", "cos"))
    return lambda x: np.array([sine(x), cosine(x)])


def near_quarter_turns() -> np.ndarray:
    """The numbers nearest to multiples of π/2, where one of the two is all but zero."""
    turns = np.r_[1:65, 2 ** np.arange(6, 20), 3 ** np.arange(4, 13), 636_500:636_600]
    with mpmath.workdps(60):
        nearest = [float(int(k) * mpmath.pi / 2) for k in turns]
    return np.array(nearest)


def numbers(rng: np.random.Generator) -> dict[str, np.ndarray]:
    quarters = near_quarter_turns()
    return {
        "small": np.r_[0.0, 10.0 ** np.arange(-300, 0, 13.0), 10.0 ** np.linspace(-8, 0, 256)],
        "a few turns": rng.uniform(-20.0, 20.0, 800),
        "many turns": rng.uniform(-1e6, 1e6, 800),
        "near quarter turns": np.r_[quarters, quarters * (1.0 - 2.0**-52), 1e6, -1e6],
        "far out": 10.0 ** rng.uniform(6.0, 15.0, 400) * rng.choice([-1.0, 1.0], 400),
    }


def share(found: np.ndarray, wanted: list[mpmath.mpf]) -> float:
    """Largest difference as a part of what is allowed: a unit of the last place, ``REDUCTION``."""
    pairs = zip(found.tolist(), wanted, strict=True)
    return max(
        float(abs(y - exact)) / (np.spacing(abs(float(exact))) + REDUCTION) for y, exact in pairs
    )


@pytest.mark.parametrize("language", LANGUAGES)
def test_within_one_unit_of_the_last_place(language: str, rng: np.random.Generator) -> None:
    values = both(language)
    for name, x in numbers(rng).items():
        sine, cosine = values(x)
        with mpmath.workdps(60):
            exact = [mpmath.mpf(value) for value in x.tolist()]
            assert share(sine, [mpmath.sin(value) for value in exact]) < 1.0, name
            assert share(cosine, [mpmath.cos(value) for value in exact]) < 1.0, name


def test_lanes_give_the_same_bits(rng: np.random.Generator) -> None:
    """Also where some lanes of a vector are out of range or NaN."""
    alone, lanes = map(both, LANGUAGES)
    x = rng.permutation(np.concatenate([*numbers(rng).values(), [np.nan, np.inf, -np.inf, -0.0]]))
    np.testing.assert_array_equal(alone(x).view(np.int64), lanes(x).view(np.int64))


def test_what_is_no_number_stays_none() -> None:
    for language in LANGUAGES:
        assert np.isnan(both(language)(np.array([np.nan, np.inf, -np.inf, np.nan]))).all()
