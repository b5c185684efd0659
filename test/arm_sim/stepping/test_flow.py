# SPDX-License-Identifier: Apache-2.0
"""Error control in compiled code, on x' = -r x by Heun's method with Euler's error."""

from __future__ import annotations

import numpy as np
import pytest

from arm_sim.stepping.adaptive import SubstepControl, controlled_tick
from models.engine import decay
from tolerances import assert_close

START = np.array([2.0, 1.0])


def control(tolerance: float) -> SubstepControl:
    return SubstepControl(tolerance, 2)


def heun(x: np.ndarray, u: np.ndarray, p: np.ndarray, h: float) -> list[np.ndarray]:
    """The same attempt for the loop in Python."""
    error = 0.5 * u**2 * h**2 * abs(x)
    return [x * (1 - u * h + 0.5 * u**2 * h**2), error.max(keepdims=True), error[:1]]


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-5])
@pytest.mark.parametrize("rate", [1.0, 50.0, -3.0])
def test_both_loops_take_the_same_steps(tolerance: float, rate: float) -> None:
    """Compiled code and Python, over some ticks: states, sub-steps, errors, what is next."""
    one, other = control(tolerance), control(tolerance)
    x, y = START.copy(), START.copy()
    for h in (0.1, 0.3, 0.01, 0.2):
        after = decay(x, rate, h, one)
        assert after is not None
        assert controlled_tick(heun, y, np.array([rate]), np.zeros(0), h, other)  # type: ignore[arg-type]
        x = after
        assert_close(x, y, 1e-12)
        assert one.attempts == other.attempts
        np.testing.assert_allclose([one.step, one.error], [other.step, other.error], rtol=1e-9)


def test_steps_are_as_long_as_the_tolerance_allows() -> None:
    """Error h² r² x / 2 of 0.81 of the tolerance: sub-steps of 0.9 sqrt(2 tol / x) / r."""
    kept = control(1e-6)
    assert decay(START, 1.0, 0.1, kept) is not None
    ideal = 0.9 * np.sqrt(2e-6 / 2.0)
    assert 0.1 / ideal < kept.attempts < 1.15 * 0.1 / ideal
    assert_close(kept.step, 0.9 * np.sqrt(2e-6 / (2.0 * np.exp(-0.1))), 1e-5)
    assert_close(kept.error / 0.1, 0.5 * ideal * 2.0, 1e-4)
