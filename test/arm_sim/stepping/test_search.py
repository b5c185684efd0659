# SPDX-License-Identifier: Apache-2.0
"""The search for the instant of an event, compiled: exact to rounding, and in few trials."""

from collections.abc import Callable

import numpy as np
import pytest

from models.engine import locate
from tolerances import assert_close

SHAPES: dict[str, Callable[[float, float], float]] = {
    "straight": lambda t, root: t - root,
    "flat": lambda t, root: (t - root) ** 3,
    "steep": lambda t, root: float(np.expm1(40 * (t - root))),
    "level, then steep": lambda t, root: float(np.expm1(-3 * (root - t))) * (1 + 100 * t**4),
    "bent the other way": lambda t, root: float(np.log1p(20 * (t - root) / (1 + 20 * root))),
}


@pytest.mark.parametrize("root", [0.3, 1e-9, 0.999999999, 0.71234])
@pytest.mark.parametrize("f", SHAPES.values(), ids=SHAPES)
def test_the_instant_is_found_to_rounding(f: Callable[[float, float], float], root: float) -> None:
    """Positive at the answer, not just before it."""
    found = locate(lambda t: f(t, root), 1.0).at
    assert f(found, root) > 0.0 and f(found - 1e-15, root) <= 0.0


def test_of_several_values_the_first_is_found() -> None:
    """In about as many trials as one takes, whatever their scales: the largest has a kink."""
    late, soon = (lambda t: 1e3 * np.sin(t - 0.7)), (lambda t: 1e-9 * np.expm1(5 * (t - 0.31)))
    for never in (-1e-12, 0.0):  # zero: as of a joint that friction just holds
        found = locate([late, soon, lambda t, never=never: never], 1.0)
        assert_close(found.at, 0.31, 1e-15)
        assert found.evaluations <= 20


def test_values_that_are_rounding_take_few_trials() -> None:
    """As of a joint that cannot move by less than the last digit of its position."""
    found = locate(lambda t: np.round((t - 0.4) * 1e6) * 1e-18 - 1e-20, 1.0, nothing=1e-15)
    assert_close(found.at, 0.4, 1e-4)
    assert found.evaluations <= 20


def test_what_is_positive_at_once_is_found_at_once() -> None:
    """The first instant of a mode that is wrong from the start."""
    assert locate(lambda t: t + 1e-12, 1.0).at < 1e-15


def test_the_first_of_a_touch_and_a_wall() -> None:
    """Past the event the motion cannot be computed at all."""
    found = locate(lambda t: np.sin(t - 0.3) if t < 0.6 else np.inf, 1.0)
    assert_close(found.at, 0.3, 1e-15)
    assert found.evaluations <= 30
