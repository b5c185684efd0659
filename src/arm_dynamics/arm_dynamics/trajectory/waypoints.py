# SPDX-License-Identifier: Apache-2.0
"""Joint trajectories of quintic segments: position, velocity and acceleration are continuous.

Each segment is the quintic fixed by position, velocity and acceleration at its two ends
(Craig, Introduction to Robotics, section 7.3). Free values of a waypoint are chosen to minimize
the integral of the squared jerk over the whole trajectory (Flash and Hogan, Journal of
Neuroscience 5(7), 1985): where velocity and acceleration are free, jerk and snap are continuous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, numbers
from arm_dynamics.exceptions import InvalidInput, plain
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.quintics import extremes
from arm_dynamics.trajectory.reference import Reference, Waypoint
from arm_dynamics.trajectory.trajectory import Trajectory

MAX_WAYPOINTS = 10_001  # 10 000 after the start
_STRETCH_TRIES = 60  # of factors, each larger by 2 % to a factor of 2
_BALANCE_ROUNDS = 8  # of changed durations, of which the fastest motion is taken


def quintic(waypoints: Sequence[Waypoint], limits: Limits | None = None) -> Trajectory:
    """Pass waypoints at their times, or slower if limits require it.

    The motion starts with the velocity and acceleration of the first waypoint (zero by default)
    and ends at rest. If a velocity or acceleration exceeds its limit, all times are stretched by
    one factor, and velocities of waypoints are reduced accordingly, which preserves the
    path. Only the motion at the first waypoint is kept, since it is the arm's current motion.

    Args:
        waypoints: At least two, the first at time 0, with increasing times.
        limits: Limits of the motion, or None.

    Returns:
        The trajectory; its ``stretch`` is the factor by which it was slowed down.

    Raises:
        InvalidInput: If waypoints are malformed, or no factor brings the motion within limits, or
            one is needed though waypoints have torques, which are right for their times only.
    """
    times, q = timed_positions(waypoints)
    v = _derivative([w.v for w in waypoints], q.shape[1], "velocity")
    a = _derivative([w.a for w in waypoints], q.shape[1], "acceleration")
    return with_torques(_limited_motion(Knots(times, q, v, a), limits), waypoints)


def _limited_motion(knots: Knots, limits: Limits | None) -> Trajectory:
    """The motion through knots, without torques."""
    if limits is None:
        return knots.trajectory(1.0)
    _check_positions(knots.q, knots.q[0], limits)
    stretch, from_rest = 1.0, not (knots.v[0].any() or knots.a[0].any())
    for _ in range(_STRETCH_TRIES):
        trajectory = knots.trajectory(stretch)
        peaks = extremes(trajectory.coefficients)
        excess = float(segment_excess(trajectory, peaks, limits).max())
        if excess <= 1.0 + 1e-9 or from_rest:
            _check_positions(np.concatenate(peaks[:, 0]), knots.q[0], limits)
            return trajectory if excess <= 1.0 else knots.trajectory(stretch * excess)
        stretch *= min(max(excess, 1.02), 2.0)
    raise InvalidInput(
        f"the motion at the start, velocity {knots.v[0]} and acceleration {knots.a[0]}, cannot be "
        "led to the waypoints within velocity and acceleration limits at any pace; allowed: "
        "waypoints that leave room to slow down, or a start nearer to rest"
    )


def quintic_through(positions: ArrayLike, limits: Limits) -> Trajectory:
    """Pass through positions as fast as limits allow, from rest to rest.

    Durations start from the rest-to-rest quintic (peak speed 15/8 Δq/h, peak acceleration
    10/√3 Δq/h²; Craig, section 7.3), are balanced between segments in a few rounds, of which the
    shortest counts, and then scaled as a whole, so that one limit is reached and none is exceeded.

    Args:
        positions: Points to pass, shape (w, n), w >= 2, neighbours different.
        limits: Velocity or acceleration must be finite for every joint that moves.

    Returns:
        The trajectory.

    Raises:
        InvalidInput: If points are malformed, coincide, or nothing limits the motion.
    """
    q = numbers("positions", positions)
    if q.ndim != 2 or len(q) < 2:
        raise InvalidInput(f"positions have shape {q.shape}; allowed: (w, n) with w >= 2")
    step = np.abs(np.diff(q, axis=0))
    h = np.fmax(
        15 / 8 * step / limits.velocity, np.sqrt(10 / np.sqrt(3) * step / limits.acceleration)
    ).max(axis=1)
    if not np.all(h > 0.0):
        i = int(np.argmin(h > 0.0))
        raise InvalidInput(
            f"positions {i} and {i + 1} coincide or nothing limits the motion between them; "
            "allowed: different positions and finite velocity or acceleration limits"
        )
    durations = []
    for _ in range(_BALANCE_ROUNDS):
        trajectory = quintic(_waypoints_at(h, q))
        excess = segment_excess(trajectory, extremes(trajectory.coefficients), limits)
        durations.append(h * excess.max())
        h = h * np.sqrt(excess)
    # Balancing need not converge: a longer segment may make the motion in the next one wider.
    return quintic(_waypoints_at(min(durations, key=np.sum), q), limits)


def stop(here: Reference, limits: Limits, least: float = 0.2) -> Trajectory:
    """Decelerate all joints smoothly to rest, wherever that is.

    The speed is v (1 - 3 s² + 2 s³), so the distance is v T/2 and the deceleration at most 1.5
    v/T. Torques to add stay what they are.

    Args:
        here: The motion to end.
        limits: Limits of the motion.
        least: Shortest duration in [s].

    Raises:
        InvalidInput: If it cannot be ended within limits.
    """
    time = max(least, 1.5 * float(np.max(abs(here.v) / limits.acceleration)))
    start = Waypoint(0.0, here.q, here.v, here.a, here.tau)
    end = Waypoint(time, here.q + 0.5 * time * here.v, tau=here.tau)
    return quintic([start, end], limits)


class Knots(NamedTuple):
    """Checked waypoints as arrays.

    Attributes:
        times: Times in [s], shape (w,).
        q: Positions, shape (w, n).
        v: Velocities, likewise; rows of NaN are open.
        a: Accelerations, likewise.
    """

    times: Array
    q: Array
    v: Array
    a: Array

    def slower(self, stretch: float) -> Knots:
        """All times multiplied by ``stretch``, with the same motion at the start."""
        slower = np.full((len(self.times), 1), stretch)
        slower[0] = 1.0
        return Knots(self.times * stretch, self.q, self.v / slower, self.a / slower**2)

    def trajectory(self, stretch: float) -> Trajectory:
        """Quintic segments, this much slower."""
        return Trajectory.through(*self.slower(stretch), stretch)


def have_torques(waypoints: Sequence[Waypoint], first: int = 0) -> bool:
    """Whether waypoints, all or none, have torques; ``first`` numbers the first one."""
    missing = [i for i, w in enumerate(waypoints) if w.tau is None]
    if missing and len(missing) < len(waypoints):
        raise InvalidInput(
            f"waypoint {missing[0] + first} has no torques, others have; allowed: all or none"
        )
    return not missing


def with_torques(motion: Trajectory, waypoints: Sequence[Waypoint]) -> Trajectory:
    """Add the torques of waypoints, if they have any, to the motion through them.

    Raises:
        InvalidInput: If only some have torques, one is malformed, or the motion is slower than the
            waypoints say, so that their torques do not belong to it.
    """
    if not have_torques(waypoints):
        return motion
    if motion.stretch > 1.0:
        raise InvalidInput(
            f"the motion would have to be {motion.stretch:.4g} times slower for its limits, and "
            "its torques belong to the times given; allowed: times that keep the limits, or "
            "waypoints without torques"
        )
    n = motion.ends.shape[1]
    return replace(motion, torques=rows_or_nan([w.tau for w in waypoints], n, "torque"))


def check_kind(waypoints: Sequence[Waypoint], first: int = 0) -> None:
    """Check that these are waypoints; ``first`` is the number of the first one in messages."""
    allowed = "allowed: a list of waypoints, such as [Waypoint(1.0, [0.5, -0.2])]"
    if not isinstance(waypoints, Sequence) or isinstance(waypoints, str):
        raise InvalidInput(f"waypoints = {plain(waypoints, 80)}; {allowed}")
    for i, waypoint in enumerate(waypoints, first):
        if not isinstance(waypoint, Waypoint):
            raise InvalidInput(f"waypoint {i} is {plain(waypoint, 80)}; {allowed}")
        if not isinstance(waypoint.time, Real):
            raise InvalidInput(f"time of waypoint {i} = {waypoint.time!r}; a number is expected")


def timed_positions(waypoints: Sequence[Waypoint]) -> tuple[Array, Array]:
    """Check and stack times, shape (w,), and positions, shape (w, n).

    Raises:
        InvalidInput: If these are no waypoints, there are too few or too many, times do not
            increase from 0, or positions differ in length or are not finite.
    """
    check_kind(waypoints)
    if not 2 <= len(waypoints) <= MAX_WAYPOINTS:
        raise InvalidInput(f"{len(waypoints)} waypoints; allowed: 2 to {MAX_WAYPOINTS}")
    times = np.array([w.time for w in waypoints], float)
    if not np.all(np.isfinite(times)) or times[0] != 0.0 or np.any(np.diff(times) <= 0.0):
        raise InvalidInput(f"waypoint times are {times} s; allowed: increasing from 0")
    n, rows = np.size(waypoints[0].q), enumerate(waypoints)
    return times, np.stack([_row(f"position of waypoint {i}", w.q, n) for i, w in rows])


def rows_or_nan(rows: Sequence[ArrayLike | None], n: int, quantity: str) -> Array:
    """Check and stack values of waypoints, shape (w, n); NaN in rows that are None."""
    free = np.full(n, np.nan)
    names = (f"{quantity} of waypoint {i}" for i in range(len(rows)))
    pairs = zip(names, rows, strict=True)
    return np.stack([free if row is None else _row(name, row, n) for name, row in pairs])


def _derivative(rows: list[ArrayLike | None], n: int, quantity: str) -> Array:
    """Stack derivatives of waypoints; free ends are zero, free inner rows are NaN."""
    stacked = rows_or_nan(rows, n, quantity)
    stacked[[0, -1]] = np.nan_to_num(stacked[[0, -1]])
    if np.any(stacked[-1]):
        raise InvalidInput(f"{quantity} of the last waypoint is {stacked[-1]}; allowed: zero")
    return stacked


def _row(name: str, values: ArrayLike, n: int) -> Array:
    row = numbers(name, values)
    if row.shape != (n,):
        raise InvalidInput(f"{name} has shape {row.shape}; allowed: ({n},)")
    return row


def _waypoints_at(h: Array, q: Array) -> list[Waypoint]:
    times = [0.0, *np.cumsum(h).tolist()]
    return [Waypoint(t, p) for t, p in zip(times, q, strict=True)]


def segment_excess(trajectory: Trajectory, peaks: Array, limits: Limits) -> Array:
    """Factor by which each segment is too fast, shape (w − 1,)."""
    h = np.diff(trajectory.times)[:, None]
    peaks = np.abs(peaks).max(axis=0)
    speed = peaks[1] / h / limits.velocity
    acceleration = peaks[2] / h**2 / limits.acceleration
    return np.asarray(np.maximum(speed, np.sqrt(acceleration)).max(axis=1))


def _check_positions(q: Array, start: Array, limits: Limits) -> None:
    """Reject positions beyond limits, except where the start is beyond them already."""
    beyond = np.maximum(np.minimum(limits.lower, start) - q, q - np.maximum(limits.upper, start))
    if np.all(beyond <= 1e-9):
        return
    i, joint = np.unravel_index(np.argmax(beyond), beyond.shape)
    unit = limits.unit(int(joint), "position")
    raise InvalidInput(
        f"the trajectory takes joint {limits.name(int(joint))} to {q[i, joint]:.6g}{unit}; "
        f"allowed: {limits.lower[joint]:.6g} to {limits.upper[joint]:.6g}{unit}"
    )
