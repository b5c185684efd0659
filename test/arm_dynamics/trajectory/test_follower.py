# SPDX-License-Identifier: Apache-2.0
"""References of a controller while trajectories start and end."""

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.trajectory import Follower, Limits, Reference, Waypoint
from tolerances import ALGEBRA, assert_close

SECOND = 1_000_000_000


def triple(reference: Reference) -> np.ndarray:
    return np.array([reference.q, reference.v, reference.a])


@pytest.fixture
def follower() -> Follower:
    """Stands at zero with two joints."""
    return Follower([0.0, 0.0])


def test_later_start_lets_the_old_one_go_on_until_then(follower: Follower) -> None:
    follower.follow([Waypoint(2.0, [1.0, -1.0])], 0)
    old = Follower([0.0, 0.0])
    old.follow([Waypoint(2.0, [1.0, -1.0])], 0)
    start = 1_200_000_000
    follower.follow([Waypoint(1.0, [0.0, 0.0])], SECOND // 2, start)
    assert_close(follower.remaining(SECOND // 2), 1.7, ALGEBRA)
    for now in (SECOND // 2, SECOND, start - 1, start):
        assert_close(triple(follower.reference(now)), triple(old.reference(now)), ALGEBRA)
    assert_close(triple(follower.reference(start + SECOND)), np.zeros((3, 2)), ALGEBRA)


def torques(follower: Follower, time: float) -> np.ndarray:
    tau = follower.reference(round(time * SECOND)).tau
    assert tau is not None
    return tau


def test_torques_are_linear_between_points_and_stay(follower: Follower) -> None:
    points = [Waypoint(1.0, [0.1, 0.1], tau=[2.0, 0.0]), Waypoint(3.0, [0.2, 0.0], tau=[4.0, 6.0])]
    follower.follow(points, 0)
    for time, wanted in ((0.0, [0, 0]), (0.5, [1, 0]), (1.0, [2, 0]), (2.5, [3.5, 4.5])):
        assert_close(torques(follower, time), wanted, ALGEBRA)
    assert_close(torques(follower, 99.0), [4, 6], ALGEBRA)
    follower.hold([0.2, 0.0])
    assert follower.reference(100 * SECOND).tau is None
    follower.follow([Waypoint(0.0, [0.2, 0.0], tau=[7.0, 0.0]), *points], now=101 * SECOND)
    assert_close(torques(follower, 101.0), [7.0, 0.0], ALGEBRA)


def test_torques_fade_out_to_points_that_have_none(follower: Follower) -> None:
    follower.follow([Waypoint(1.0, [0.1, 0.1], tau=[2.0, 4.0])], 0)
    follower.follow([Waypoint(2.0, [0.0, 0.0])], SECOND)
    for time, share in ((1.0, 1.0), (1.5, 0.75), (3.0, 0.0), (9.0, 0.0)):
        assert_close(torques(follower, time), np.array([2.0, 4.0]) * share, ALGEBRA)


def test_torques_of_some_points_only_are_refused(follower: Follower) -> None:
    points = [Waypoint(1.0, [0.1, 0.1]), Waypoint(2.0, [0.1, 0.1], tau=[1.0, 1.0])]
    with pytest.raises(InvalidInput, match="waypoint 1 has no torques"):
        follower.follow(points, 0)
    with pytest.raises(InvalidInput, match="torque of waypoint 1 has shape"):
        follower.follow([Waypoint(1.0, [0.1, 0.1], tau=[1.0])], 0)


def test_limits_slow_a_trajectory_down_unless_its_times_carry_torques() -> None:
    no = np.full(2, np.inf)
    follower = Follower([0.0, 0.0], Limits(np.ones(2), no, -no, no))
    trajectory = follower.follow([Waypoint(0.1, [1.0, 0.0])], 0)
    assert_close(trajectory.duration, 15 / 8, 1e-9)
    with pytest.raises(InvalidInput, match="times slower for its limits"):
        follower.follow([Waypoint(0.1, [-1.0, 1.0], tau=[1.0, 1.0])], 9 * SECOND)


def test_points_that_are_over_are_left_out_and_one_is_needed(follower: Follower) -> None:
    points = [Waypoint(1.0, [5.0, 5.0]), Waypoint(3.0, [1.0, 1.0])]
    trajectory = follower.follow(points, now=2 * SECOND, start=0)
    assert_close(trajectory.duration, 1.0, ALGEBRA)
    assert_close(follower.reference(3 * SECOND).q, [1.0, 1.0], ALGEBRA)
    with pytest.raises(InvalidInput, match="no waypoint lies in the future"):
        follower.follow(points, now=3 * SECOND, start=0)


def test_hold_forgets_trajectories(follower: Follower) -> None:
    follower.follow([Waypoint(2.0, [1.0, -1.0])], 0)
    follower.follow([Waypoint(2.0, [2.0, -1.0])], 0, SECOND)
    follower.hold([3.0, 3.0])
    for now in (0, SECOND, 9 * SECOND):
        assert_close(triple(follower.reference(now)), [[3.0, 3.0], [0, 0], [0, 0]], ALGEBRA)
