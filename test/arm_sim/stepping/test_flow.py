# SPDX-License-Identifier: Apache-2.0
"""Error control in compiled code, on x' = -r x by Heun's method with Euler's error."""

import numpy as np
import pytest

from arm_sim.stepping.adaptive import SubstepControl
from models.engine import decay
from tolerances import assert_close

START = np.array([2.0, 1.0])


def control(tolerance: float) -> SubstepControl:
    return SubstepControl(tolerance, 2)


def test_steps_are_as_long_as_the_tolerance_allows() -> None:
    """Error h² r² x / 2 of 0.81 of the tolerance: sub-steps of 0.9 sqrt(2 tol / x) / r."""
    kept = control(1e-6)
    assert decay(START, 1.0, 0.1, kept) is not None
    ideal = 0.9 * np.sqrt(2e-6 / 2.0)
    assert 0.1 / ideal < kept.attempts < 1.15 * 0.1 / ideal
    assert_close(kept.step, 0.9 * np.sqrt(2e-6 / (2.0 * np.exp(-0.1))), 1e-5)
    assert_close(kept.error / 0.1, 0.5 * ideal * 2.0, 1e-4)


def test_nothing_to_do_lengthens_the_step_by_six_at_most() -> None:
    kept = control(1e-3)
    kept.step = 1e-3
    assert decay(START, 0.0, 1.0, kept) is not None
    # 1, 6, 36 and 216 ms, and the rest of the second in one, though 1.296 s would have been tried.
    assert kept.attempts == 5
    assert_close(kept.step, 6 * (1.0 - 0.259), 1e-12)


def test_a_last_piece_cut_short_does_not_shorten_the_next_tick() -> None:
    kept = control(1e-3)
    kept.step = 1e-2
    assert decay(START, 0.5, 1.5e-2, kept) is not None
    before = kept.step
    assert before > 1e-2
    assert decay(START, 0.5, 1e-6, kept) is not None
    assert kept.step >= before


def test_too_long_a_step_is_tried_again() -> None:
    """An error 10^8 times too large: a fifth each time, and only good steps move the state."""
    kept = control(1e-6)
    after = decay(START, 100.0, 1e-2, kept)
    assert after is not None
    assert_close(after, START * np.exp(-1.0), 1e-3)
    assert_close(after[0] / after[1], 2.0, 1e-14)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e160])
def test_numbers_out_of_reach_are_given_up(bad: float) -> None:
    kept = control(1e-3)
    assert decay(np.array([1.0, bad]), 1.0, 0.1, kept) is None
    assert kept.attempts < 30


def test_too_many_sub_steps_are_given_up() -> None:
    """The library of this test allows 2000."""
    kept = control(1e-12)
    assert decay(START, 1.0, 1.0, kept) is None
    assert kept.attempts == 2000
