# SPDX-License-Identifier: Apache-2.0
"""Velocities derived from positions, against closed forms."""

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.control.derived_velocity import DerivedVelocity
from tolerances import ALGEBRA, assert_close

DT, MS = 1e-3, 1_000_000


@pytest.mark.parametrize("cutoff", [0.0, 20.0, 150.0])
def test_a_ramp_of_the_velocity_comes_as_late_as_stated(cutoff: float) -> None:
    velocity, slope = DerivedVelocity(2, DT, cutoff), np.array([3.0, -1.0])
    for k in range(500):
        t = k * DT
        v = velocity(k * MS, 0.5 * slope * t**2)
    assert_close(v, slope * (t - velocity.delay), 1e-9)


def test_it_begins_at_rest_and_again_after_a_restart() -> None:
    velocity = DerivedVelocity(1, DT, 0.0)
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
        DerivedVelocity(1, DT, cutoff)
