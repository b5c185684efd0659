# SPDX-License-Identifier: Apache-2.0
"""Joint trajectories interpolated as in ROS, by segments that depend on their points' data.

A segment is linear if its points have positions only, cubic if both also have velocities, and
quintic if both also have accelerations. The motion between two points thus depends on them alone:
velocities jump between linear segments, accelerations between cubic ones. Source: "Trajectory
Representation" in the documentation of joint_trajectory_controller (ros2_controllers, Jazzy).
"""

from collections.abc import Callable, Sequence

import numpy as np

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.trajectory.quintics import segment_coefficients
from arm_dynamics.trajectory.reference import Waypoint
from arm_dynamics.trajectory.trajectory import Trajectory
from arm_dynamics.trajectory.waypoints import Knots, rows_or_nan, timed_positions, with_torques

# Speed in [rad/s] or [m/s] that is tolerated as rest at the end
REST_SPEED = float(np.finfo(np.float32).eps)
_TRIES = 60  # of factors, each larger by 0.1 % to a factor of 4


def spline(waypoints: Sequence[Waypoint]) -> Trajectory:
    """A trajectory through waypoints at their times, at rest after the last.

    Args:
        waypoints: At least two, the first at time 0, with increasing times.

    Raises:
        InvalidInput: If waypoints are malformed, have accelerations without velocities, or the
            last velocity is not zero.
    """
    return with_torques(_trajectory(_knots(waypoints), 1.0), waypoints)


def stretched_spline(
    waypoints: Sequence[Waypoint], excess: Callable[[Trajectory], float]
) -> Trajectory:
    """The trajectory of ``spline``, slowed down by a factor until no limit is exceeded.

    Velocities and accelerations of waypoints are reduced accordingly, except at the first
    one, since it is the arm's current motion.

    Args:
        waypoints: As of ``spline``.
        excess: Returns the factor by which a trajectory is too fast; at most one if it is not.

    Raises:
        InvalidInput: As ``spline``, or if no factor is enough.
    """
    knots, stretch = _knots(waypoints), 1.0
    for _ in range(_TRIES):
        trajectory = _trajectory(knots, stretch)
        factor = excess(trajectory)
        if factor <= 1.0:
            return with_torques(trajectory, waypoints)
        stretch *= min(max(factor, 1.001), 4.0)
    raise InvalidInput(
        f"no factor brings the trajectory within limits, not even {stretch:.3g}; "
        "allowed: points that leave room for the motion at the start"
    )


def _trajectory(knots: Knots, stretch: float) -> Trajectory:
    times, q, v, a = knots.slower(stretch)
    h, d = np.diff(times), np.diff(q, axis=0)
    linear, cubic = np.zeros((2, *d.shape, 6))
    linear[..., 0] = cubic[..., 0] = q[:-1]
    linear[..., 1] = d
    v0, v1 = v[:-1] * h[:, None], v[1:] * h[:, None]
    cubic[..., 1] = v0
    cubic[..., 2] = 3.0 * d - 2.0 * v0 - v1  # Craig, Introduction to Robotics, section 7.3
    cubic[..., 3] = v0 + v1 - 2.0 * d
    quintic = segment_coefficients(h, q, v, a)
    by_v, by_a = (~np.isnan(x[:-1]) & ~np.isnan(x[1:]) for x in (v, a))
    coefficients = np.where(by_v[..., None], np.where(by_a[..., None], quintic, cubic), linear)
    return Trajectory(times, coefficients, q[[0, -1]], stretch)


def _knots(waypoints: Sequence[Waypoint]) -> Knots:
    times, q = timed_positions(waypoints)
    n = q.shape[1]
    v = rows_or_nan([w.v for w in waypoints], n, "velocity")
    a = rows_or_nan([w.a for w in waypoints], n, "acceleration")
    for i in np.flatnonzero(np.isnan(v[:, 0]) & ~np.isnan(a[:, 0])):
        raise InvalidInput(f"waypoint {i} gives accelerations, but no velocities")
    if np.any(np.abs(np.nan_to_num(v[-1])) > REST_SPEED):
        raise InvalidInput(f"velocity of the last waypoint is {v[-1]}; allowed: zero")
    return Knots(times, q, v, a)
