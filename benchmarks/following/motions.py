# SPDX-License-Identifier: Apache-2.0
"""Trajectories as motion planners send them: timed, sampled, with velocities and accelerations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.arrays import Array
from arm_dynamics.trajectory import Trapezoid, Waypoint, quintic

SAMPLE = 0.1  # [s] from one point to the next: MoveIt's resample_dt
Motion = Callable[[float], tuple[Array, Array, Array]]


def straight(here: Array, there: Array, speed: Array, acceleration: float) -> tuple[Motion, float]:
    """From rest to rest on a line in joint space, as quick as limits allow: trapezoids in time.

    On a line this is what the time-optimal parametrization of MoveIt gives (Kunz and Stilman,
    "Time-optimal trajectory generation for path following", RSS 2012).

    Args:
        here: Where it begins, shape (n,).
        there: Where it ends.
        speed: Largest speeds in [rad/s], shape (n,).
        acceleration: Largest acceleration in [rad/s²].

    Returns:
        The motion over time and its duration in [s].
    """
    way = there - here
    timing = Trapezoid.within(
        1.0, float(np.min(speed / np.abs(way))), acceleration / float(np.abs(way).max())
    )

    def at(t: float) -> tuple[Array, Array, Array]:
        share, rate, rise = timing.at(t)
        return here + way * share, way * rate, way * rise

    return at, timing.duration


def onward(here: Array, v: Array, there: Array, duration: float) -> tuple[Motion, float]:
    """To a position from a motion under way, smoothly."""
    still = np.zeros_like(here)
    course = quintic([Waypoint(0.0, here, v, still), Waypoint(duration, there)])

    def at(t: float) -> tuple[Array, Array, Array]:
        reference = course.sample(t)
        return reference.q, reference.v, reference.a

    return at, duration


def message(motion: Motion, duration: float, names: Sequence[str]) -> JointTrajectory:
    """The motion as a planner writes it: a point each ``SAMPLE`` from 0 s on, and the last one."""
    inner = np.arange(0.0, duration - 0.2 * SAMPLE, SAMPLE)
    points = [_point(t, *motion(max(t, 1e-9))) for t in inner.tolist()]  # past a jump at the start
    q, v, a = motion(duration * (1.0 - 1e-9))
    last = _point(duration, motion(duration)[0], np.zeros_like(v), a)
    return JointTrajectory(joint_names=list(names), points=[*points, last])


def _point(t: float, q: Array, v: Array, a: Array) -> JointTrajectoryPoint:
    made = JointTrajectoryPoint(
        positions=q.tolist(), velocities=v.tolist(), accelerations=a.tolist()
    )
    seconds, nanoseconds = divmod(round(1e9 * t), 10**9)
    made.time_from_start.sec, made.time_from_start.nanosec = seconds, nanoseconds
    return made
