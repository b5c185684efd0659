# SPDX-License-Identifier: Apache-2.0
"""Sine and cosine of generated code, alone and in lanes, against 60 digits of mpmath."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import mpmath
import numpy as np
import pytest

from arm_dynamics.codegen import compiler

LANES = 4
LOOP = """
void both(long long n, const double* x, double* s, double* c) {
  for (long long i = 0; i < n; i += LANES) {
    real a = 0.0;
    for (int k = 0; k < LANES; ++k) LANE(a, k) = x[i + k];
    const real sine = sin(a), cosine = cos(a);
    for (int k = 0; k < LANES; ++k) { s[i + k] = LANE(sine, k); c[i + k] = LANE(cosine, k); }
  }
}
"""
EXPORTED = '__attribute__((visibility("default")))'
SOURCES = {
    "c": f'#include "scalar.h"\n{EXPORTED}{LOOP}',
    "c++": f'#define LANES {LANES}\n#include "lanes.hpp"\nextern "C" {EXPORTED}{LOOP}',
}
REDUCTION = 1e-20  # error of what is left of an argument when quarter turns are taken off
Both = Callable[[np.ndarray], np.ndarray]


def built(language: str) -> Both:
    """What gives sine and cosine, shape (2, k), of k numbers, by the code in that language."""
    if compiler.find_compiler(language) is None:
        pytest.skip(f"no compiler of {language}")
    run = compiler.build(SOURCES[language], language).library.both
    run.argtypes = [ctypes.c_longlong] + [ctypes.c_void_p] * 3

    def both(x: np.ndarray) -> np.ndarray:
        x = np.ascontiguousarray(x, float)
        assert len(x) % LANES == 0
        found = np.empty((2, len(x)))
        run(len(x), x.ctypes.data, found[0].ctypes.data, found[1].ctypes.data)
        return found

    return both


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


@pytest.mark.parametrize("language", SOURCES)
def test_within_one_unit_of_the_last_place(language: str, rng: np.random.Generator) -> None:
    both = built(language)
    for name, x in numbers(rng).items():
        x = np.resize(x, len(x) + -len(x) % LANES)
        sine, cosine = both(x)
        with mpmath.workdps(60):
            exact = [mpmath.mpf(value) for value in x.tolist()]
            assert share(sine, [mpmath.sin(value) for value in exact]) < 1.0, name
            assert share(cosine, [mpmath.cos(value) for value in exact]) < 1.0, name


def test_lanes_give_the_same_bits(rng: np.random.Generator) -> None:
    """Also where some lanes of a vector are out of range or NaN."""
    alone, lanes = built("c"), built("c++")
    x = rng.permutation(np.concatenate([*numbers(rng).values(), [np.nan, np.inf, -np.inf, -0.0]]))
    x = np.resize(x, len(x) + -len(x) % LANES)
    np.testing.assert_array_equal(alone(x).view(np.int64), lanes(x).view(np.int64))


def test_what_is_no_number_stays_none() -> None:
    for language in SOURCES:
        assert np.isnan(built(language)(np.array([np.nan, np.inf, -np.inf, np.nan]))).all()
