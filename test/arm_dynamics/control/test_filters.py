# SPDX-License-Identifier: Apache-2.0
"""The low-pass filter against SciPy's, and velocities derived from positions, by closed forms."""

import numpy as np
import pytest
import scipy

from arm_dynamics import InvalidInput
from arm_dynamics.control.filters.derived_velocity import DerivedVelocity
from arm_dynamics.control.filters.low_pass import LowPass
from tolerances import ALGEBRA, assert_close

DT, CUTOFF = 1e-3, 50.0


@pytest.mark.parametrize("order", [1, 2])
def test_it_is_the_butterworth_filter(order: int, rng: np.random.Generator) -> None:
    x = rng.normal(size=(500, 2))
    both = LowPass(order, [CUTOFF, 120.0], DT)
    y = np.array([both.filtered(row).copy() for row in x])
    for joint, cutoff in enumerate((CUTOFF, 120.0)):
        expected = scipy.signal.lfilter(
            *scipy.signal.butter(order, cutoff, fs=1.0 / DT), x[:, joint]
        )
        np.testing.assert_allclose(y[:, joint], expected, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_settled_it_repeats_what_it_is_given(order: int, rng: np.random.Generator) -> None:
    """And without a cutoff everything passes."""
    low_pass, x = LowPass(order, [CUTOFF, 0.0], DT), np.array([3.0, -2.0])
    low_pass.settle(x)
    for x[1] in rng.normal(size=5):
        np.testing.assert_allclose(low_pass.filtered(x), x, rtol=1e-14)


TICK, MS = 1e-3, 1_000_000


@pytest.mark.parametrize("cutoff", [0.0, 20.0, 150.0])
def test_a_ramp_of_the_velocity_comes_as_late_as_stated(cutoff: float) -> None:
    velocity, slope = DerivedVelocity(2, TICK, cutoff), np.array([3.0, -1.0])
    for k in range(500):
        t = k * TICK
        v = velocity(k * MS, 0.5 * slope * t**2)
    assert_close(v, slope * (t - velocity.delay), 1e-9)


def test_it_begins_at_rest_and_again_after_a_restart() -> None:
    velocity = DerivedVelocity(1, TICK, 0.0)
    assert velocity(0, np.array([5.0])) == 0.0
    assert_close(velocity(MS, np.array([5.002])), [2.0], ALGEBRA)
    assert_close(velocity(MS, np.array([5.002])), [2.0], ALGEBRA)
    assert_close(velocity(4 * MS, np.array([5.008])), [2.0], ALGEBRA)
    velocity.restart()
    assert velocity.last == 0.0
    assert velocity(9 * MS, np.array([-1.0])) == 0.0


@pytest.mark.parametrize("cutoff", [-1.0, 500.0, float("nan")])
def test_a_cutoff_that_no_filter_has_is_refused(cutoff: float) -> None:
    with pytest.raises(InvalidInput, match="velocity_cutoff = .*less than 500 Hz"):
        DerivedVelocity(1, TICK, cutoff)
