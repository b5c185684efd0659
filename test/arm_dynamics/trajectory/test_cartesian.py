# SPDX-License-Identifier: Apache-2.0
"""Paths of a frame through space: its orientation on lines and circles."""

import numpy as np
import pinocchio as pin
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.task_space import Pose
from arm_dynamics.trajectory import Quintic, Trapezoid, circle, line
from tolerances import ALGEBRA, FINITE_DIFF, assert_close


def test_slerp_turns_evenly_about_one_axis() -> None:
    start = Pose(np.zeros(3), pin.exp3(np.array([0.1, 0.4, -0.2])))
    end = Pose(np.array([1.0, 0, 0]), pin.exp3(np.array([0.0, -1.0, 2.0])))
    way = line(start, end)
    np.testing.assert_allclose(way.at(1.0).rotation, end.rotation, atol=1e-12)
    whole = pin.log3(end.rotation @ start.rotation.T)
    half = pin.log3(way.at(0.5).rotation @ start.rotation.T)
    np.testing.assert_allclose(half, 0.5 * whole, atol=1e-12)
    h = 1e-6
    rate = pin.log3(way.at(0.3 + h).rotation @ way.at(0.3 - h).rotation.T) / (2 * h)
    np.testing.assert_allclose(rate, way.at(0.3).first[3:], atol=1e-8)


@pytest.mark.parametrize("turning", [True, False])
def test_on_a_circle_the_frame_turns_with_it_or_keeps_its_rotation(turning: bool) -> None:
    start = Pose(np.array([0.5, 0.0, 0.3]), pin.exp3(np.array([0.1, 0.4, -0.2])))
    centre = np.array([0.5, 0.1, 0.3])
    way = circle(start, centre, [0, 0, -2], 1.2, turning)
    for u in (0.0, 0.3, 1.0):
        place = way.at(u)
        turned = pin.exp3(np.array([0.0, 0.0, -1.2 * u]))
        assert_close(place.position - centre, turned @ (start.position - centre), ALGEBRA)
        wanted = turned @ start.rotation if turning else start.rotation
        assert_close(place.rotation, wanted, ALGEBRA)
    h = 1e-6
    before, here, after = (way.at(0.4 + d) for d in (-h, 0.0, h))
    rate = np.concatenate(
        [after.position - before.position, pin.log3(after.rotation @ before.rotation.T)]
    )
    assert_close(here.first, rate / (2 * h), FINITE_DIFF)


def test_a_circle_goes_the_other_way_round_by_a_negative_angle() -> None:
    start = Pose(np.array([0.5, 0.0, 0.3]), np.eye(3))
    there = circle(start, [0.5, 0.1, 0.3], [0, 0, 1], -0.9)
    same = circle(start, [0.5, 0.1, 0.3], [0, 0, -1e200], 0.9)
    for u in (0.2, 1.0):
        assert_close(there.at(u).position, same.at(u).position, ALGEBRA)


@pytest.mark.parametrize("law", [Quintic, Trapezoid])
@pytest.mark.parametrize("length", [0.1249, 0.1251])
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


def test_too_short_for_full_speed_it_is_a_triangle() -> None:
    """√(L/a) up and as long down: full speed would take L >= v²/a = 0.125."""
    length = 0.1249
    timing = Trapezoid.within(length, 0.5, 2.0)
    ramp = np.sqrt(length / 2.0)
    assert_close([timing.ramp, timing.duration], [ramp, 2.0 * ramp], ALGEBRA)
    assert timing.at(ramp)[1] * length <= 0.5


@pytest.mark.parametrize("law", [Quintic, Trapezoid])
def test_ways_and_limits_are_positive(law: type) -> None:
    for name in ("length", "speed", "acceleration"):
        given = {"length": 1.0, "speed": 0.5, "acceleration": 2.0, name: 0.0}
        with pytest.raises(InvalidInput, match=f"^{name} is 0.0"):
            law.within(**given)
