# SPDX-License-Identifier: Apache-2.0
"""Timing laws: as fast as speed and acceleration limits allow, over short and long distances."""

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.trajectory import Quintic, Trapezoid
from tolerances import ALGEBRA, assert_close


@pytest.mark.parametrize("law", [Quintic, Trapezoid])
@pytest.mark.parametrize("length", [0.01, 0.1249, 0.1251, 0.5])
def test_timing_reaches_a_limit_and_exceeds_none(law: type, length: float) -> None:
    timing = law.within(length, 0.5, 2.0)
    t = np.linspace(0.0, timing.duration, 2001)
    u, rate, rise = np.array([timing.at(float(x)) for x in t]).T
    assert u[0] == 0.0 and abs(u[-1] - 1.0) < 1e-12
    speed, acceleration = length * rate.max() / 0.5, length * abs(rise).max() / 2.0
    assert max(speed, acceleration) <= 1.0 + 1e-9
    assert max(speed, acceleration) > 1.0 - 1e-3
    np.testing.assert_allclose(np.gradient(u, t)[5:-5], rate[5:-5], atol=3e-3 * rate.max())
    gained = np.cumsum(0.5 * (rise[1:] + rise[:-1]) * np.diff(t))
    np.testing.assert_allclose(gained, rate[1:], atol=3e-3 * rate.max())
    slow = timing.slower(2.0)
    assert slow.duration == 2 * timing.duration
    np.testing.assert_allclose(slow.at(0.6 * timing.duration)[1] * 2,
                               timing.at(0.3 * timing.duration)[1])  # fmt: skip


@pytest.mark.parametrize("length", [0.01, 0.1, 0.1249])
def test_too_short_for_full_speed_it_is_a_triangle(length: float) -> None:
    """√(L/a) up and as long down: full speed would take L >= v²/a = 0.125."""
    timing = Trapezoid.within(length, 0.5, 2.0)
    ramp = np.sqrt(length / 2.0)
    assert_close([timing.ramp, timing.duration], [ramp, 2.0 * ramp], ALGEBRA)
    assert timing.at(ramp)[1] * length <= 0.5


@pytest.mark.parametrize("law", [Quintic, Trapezoid])
@pytest.mark.parametrize("name", ["length", "speed", "acceleration"])
def test_ways_and_limits_are_positive(law: type, name: str) -> None:
    given = {"length": 1.0, "speed": 0.5, "acceleration": 2.0, name: 0.0}
    with pytest.raises(InvalidInput, match=f"^{name} is 0.0"):
        law.within(**given)
