# SPDX-License-Identifier: Apache-2.0
"""Lines, cubics and quintics between points, as ROS robots interpolate."""

import numpy as np
import pytest

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.trajectory import Waypoint, spline, stretched_spline
from tolerances import ALGEBRA, assert_close

REST = np.zeros(2)


def at(waypoints: list[Waypoint], *times: float) -> np.ndarray:
    """Position, velocity and acceleration of the first joint, a row for each time."""
    motion = spline(waypoints)
    return np.array([[x[0] for x in (r.q, r.v, r.a)] for r in map(motion.sample, times)])


def test_positions_alone_are_joined_by_lines() -> None:
    path = [Waypoint(0.0, [0, 1], REST, REST), Waypoint(1.0, [2, 1]), Waypoint(3.0, [1, 1])]
    assert_close(
        at(path, 0.25, 0.75, 1.5, 2.5, 3.0, 9.0),
        [[0.5, 2, 0], [1.5, 2, 0], [1.75, -0.5, 0], [1.25, -0.5, 0], [1, 0, 0], [1, 0, 0]],
        ALGEBRA,
    )


def test_velocities_make_the_cubic_of_hermite() -> None:
    """h00 q0 + h10 h v0 + h01 q1 + h11 h v1 with Hermite's basis."""
    path = [Waypoint(0.0, [1, 0], [0.5, 0], REST), Waypoint(2.0, [3, 0], [-1, 0]),
            Waypoint(3.0, [3, 0], REST)]  # fmt: skip
    s = 0.3
    exact = (
        (1 + 2 * s) * (1 - s) ** 2 * 1 + s * (1 - s) ** 2 * 2 * 0.5
        + s**2 * (3 - 2 * s) * 3 + s**2 * (s - 1) * 2 * -1
    )  # fmt: skip
    assert_close(at(path, 0.6)[0, 0], exact, ALGEBRA)
    assert_close(at(path, 0.0, 2.0)[:, 1], [0.5, -1.0], ALGEBRA)


def test_accelerations_make_the_quintic_through_six_conditions() -> None:
    ends = [[0.2, 0.5, -1.0], [1.0, -0.3, 2.0]]
    path = [Waypoint(0.0, *([x, 0] for x in ends[0])), Waypoint(0.5, *([x, 0] for x in ends[1])),
            Waypoint(1.0, [1, 0], REST, REST)]  # fmt: skip
    assert_close(at(path, 0.0, 0.5), ends, ALGEBRA)
    fifth = np.diff(at(path, *np.linspace(0.0, 0.499, 8))[:, 0], n=6)
    assert_close(fifth, np.zeros_like(fifth), 1e-12)  # a polynomial of degree five


def test_each_segment_takes_what_both_its_points_give() -> None:
    path = [Waypoint(0.0, [0, 0], REST, REST), Waypoint(1.0, [1, 0], [1, 0]),
            Waypoint(2.0, [3, 0]), Waypoint(3.0, [4, 0], REST, REST)]  # fmt: skip
    accelerations = at(path, 0.5, 1.5, 2.5)[:, 2]
    assert accelerations[0] != 0.0  # a cubic: the second point has no acceleration
    assert_close(accelerations[1:], [0, 0], ALGEBRA)  # lines: the third has no velocity


def test_it_may_end_with_an_acceleration_and_rests_then() -> None:
    braking = [Waypoint(0.0, [0, 0], [1, 0], [-1, 0]), Waypoint(1.0, [0.5, 0], REST, [-1, 0])]
    assert_close(at(braking, 0.5, 1.0), [[0.375, 0.5, -1], [0.5, 0, 0]], ALGEBRA)


def test_malformed_waypoints_are_refused() -> None:
    for last, complaint in (
        (Waypoint(1.0, [1, 1], [0.1, 0]), "velocity of the last waypoint"),
        (Waypoint(1.0, [1, 1], None, [0.1, 0]), "waypoint 1 gives accelerations, but no velocit"),
    ):
        with pytest.raises(InvalidInput, match=complaint):
            spline([Waypoint(0.0, [0, 0], REST, REST), last])


def test_stretched_it_passes_the_same_points_with_velocities_that_shrink() -> None:
    path = [Waypoint(0.0, [0, 0], REST, REST), Waypoint(1.0, [1, 0], [2, 0]),
            Waypoint(2.0, [2, 0], REST)]  # fmt: skip
    slow = stretched_spline(path, lambda trajectory: 2.5 / trajectory.stretch)
    assert slow.stretch == pytest.approx(2.5)
    assert slow.duration == pytest.approx(5.0)
    middle = slow.sample(2.5)
    assert_close([middle.q[0], middle.v[0]], [1.0, 2.0 / 2.5], ALGEBRA)


def test_what_no_pace_brings_within_limits_is_refused() -> None:
    path = [Waypoint(0.0, [0, 0], REST, REST), Waypoint(1.0, [1, 0])]
    with pytest.raises(InvalidInput, match="no factor brings"):
        stretched_spline(path, lambda trajectory: 2.0)
