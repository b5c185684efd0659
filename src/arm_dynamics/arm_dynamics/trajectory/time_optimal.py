# SPDX-License-Identifier: Apache-2.0
"""The fastest timing of a joint path within all limits of the arm.

By reachability analysis along the path (Pham and Pham, "A new approach to time-optimal path
parameterization based on reachability analysis", IEEE Trans. Robotics 34(3), 2018). Friction and
voltages that follow the speed, which the method excludes, are linearized in turn.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.trajectory.joint_paths import JointPath
from arm_dynamics.trajectory.timing.scaling import OVERSHOOT, Capacity, Strain, is_moving, slowdown
from arm_dynamics.trajectory.trajectory import Trajectory

_NODES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # of an interval: where limits are imposed
_INSET = 1e-9  # of an interval, by which its ends are: at knots of the path accelerations jump
_LIMIT_SHARE = 1.0 - 2.0 * OVERSHOOT  # of each limit, so that nothing between them exceeds it
_UNLIMITED = 1e10  # [1/s²], faster than any arm
_LARGEST_X = 1e6  # x relative to that of a timing within limits, more than any that follows
_GAP_ROUNDING = 1e-12  # relative rounding error of a gap between two limits
_STEP = 1e-6  # relative, of differences
_CONVERGENCE = 1e-4  # change of x, relative to the largest, below which it is linearized no more
_ROUNDS = 20  # linearizations at most
_SAMPLES = 33  # points of a segment of the path between which reversals of joints are searched
_BISECTIONS = 50  # until reversals are exact to rounding
_MARK_DISTANCE = 1e-9  # distance in u below which two marks are one
_MARK_CLEARANCE = 0.2  # of the distance of points: one that is nearer to a mark is left out
_LEAST_GAIN = 1e-3  # of the duration, by twice as many points; less is not worth it
_DOUBLINGS = 4  # of the number of points, at most
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Profile:
    """Timing with constant acceleration d²u/dt² between points of the path.

    Attributes:
        us: Points from 0 to 1, shape (k,).
        rates: du/dt there in [1/s], shape (k,).
        times: Times at these points in [s], shape (k,).
    """

    us: Array
    rates: Array
    times: Array

    @classmethod
    def of(cls, us: Array, rates: Array) -> Profile:
        """The timing of rates at points, of which no two neighbours are zero."""
        steps = 2.0 * np.diff(us) / (rates[1:] + rates[:-1])
        return cls(us, rates, np.concatenate([[0.0], np.cumsum(steps)]))

    @property
    def duration(self) -> float:
        """Duration in [s]."""
        return float(self.times[-1])

    def at(self, t: float) -> tuple[float, float, float]:
        """u, du/dt in [1/s] and d²u/dt² in [1/s²] at the time ``t`` in [s]."""
        if t <= 0.0 or t >= self.duration:
            return (0.0 if t <= 0.0 else 1.0), 0.0, 0.0
        i = int(np.searchsorted(self.times, t, "right")) - 1
        since, step = t - self.times[i], self.times[i + 1] - self.times[i]
        rise = (self.rates[i + 1] - self.rates[i]) / step
        rate = max(0.0, self.rates[i] + rise * since)  # rounding would reverse dry friction
        return float(self.us[i] + 0.5 * (self.rates[i] + rate) * since), float(rate), float(rise)

    def slower(self, stretch: float) -> Profile:
        """The timing with all times multiplied by ``stretch``."""
        return Profile(self.us, self.rates / stretch, self.times * stretch)


def retimed(
    motion: JointPath,
    dynamics: Dynamics,
    limit: ArrayLike | None = None,
    acceleration: ArrayLike = np.inf,
    points: int = 200,
) -> JointPath:
    """The same path as fast as limits allow, from rest to rest.

    Accelerations jump between limits. Limits hold at every instant: the whole motion is slowed
    down by what exceeds them between the points at which they are imposed (``slowdown``).

    Args:
        motion: The motion; its own timing does not matter.
        dynamics: The model, with its speed limits.
        limit: Torque limits in [N m] or [N], a number or shape (n,); None for the model's. The
            limits of the motors' currents and voltages, hence their torque-speed curves, hold in
            any case.
        acceleration: Limits of joint accelerations in [rad/s²] or [m/s²], positive, likewise.
        points: Number of intervals of the path in which limits are imposed; there are more where
            the path has knots, or dry friction changes its sign, and while twice as many make the
            motion shorter by more than 0.1 %. A warning tells what may be left after 8 times.

    Raises:
        Unreachable: If limits cannot be met at any speed.
        InvalidInput: If an argument is not allowed, or nothing limits the motion.
    """
    if points < 10:
        raise InvalidInput(f"points = {points}; at least 10 are expected")
    capacity = Capacity.of(dynamics, limit, acceleration)
    if all(quantity == "velocity" for quantity, _ in capacity.columns):
        raise InvalidInput("nothing limits the motion: no torque and no acceleration limit")
    best, gain = _fastest_on_grid(motion, capacity, points // 2), np.inf
    for _ in range(_DOUBLINGS):
        finer = _fastest_on_grid(motion, capacity, points)
        gain = 1.0 - finer.duration / best.duration
        best, points = min(best, finer, key=lambda timed: timed.duration), 2 * points
        if gain < _LEAST_GAIN:
            return best
    _log.warning("the fastest timing may be another %.1f %% shorter: it was found in steps of "
                 "1/%d of the path", 100.0 * gain, points // 2)  # fmt: skip
    return best


def _fastest_on_grid(motion: JointPath, capacity: Capacity, points: int) -> JointPath:
    """The motion with the fastest timing on a grid."""
    profile = _LimitedPath(motion, capacity, points).fastest()
    quick = JointPath(motion.over, profile)
    return quick.slower(slowdown(capacity, quick.at, profile.times))


class _LimitedPath:
    """A path with the points at which limits are imposed, several in each interval.

    Within an interval y = d²u/dt² is constant and x = (du/dt)² is linear in u, so a limit at any
    of its points is linear in y and in x at its beginning, except for friction and voltages, which
    follow the speed √x. These are linearized about a timing, and again about the faster one that
    results from it.
    """

    def __init__(self, motion: JointPath, capacity: Capacity, points: int) -> None:
        dry = capacity.dynamics.steady_friction.has_dry
        marks = np.concatenate([motion.over.times, _reversals(motion.over) if dry else []])
        self._us = _grid(points, marks)
        self._steps = np.diff(self._us)
        at = self._us[:-1, None] + self._steps[:, None] * _NODES.clip(_INSET, 1.0 - _INSET)
        q, first, second = motion.along(at.ravel())
        middle = first[len(_NODES) // 2 :: len(_NODES)]
        direction = np.repeat(np.sign(middle) * is_moving(middle), len(_NODES), axis=0)
        self._strain = Strain(capacity, q, first, second, direction)

    def fastest(self) -> Profile:
        """The fastest timing that keeps the limits at these points."""
        x = _UNLIMITED * self._us * (1.0 - self._us)
        if (pace := self._pace(x)) == 1.0:
            raise InvalidInput("nothing limits the motion along this path")
        x *= pace**2
        best: Profile | None = None
        for _ in range(_ROUNDS):
            if (faster := self._faster(x)) is None:
                break
            profile = Profile.of(self._us, np.sqrt(faster)).slower(1.0 / self._pace(faster))
            if best is None or profile.duration < best.duration:
                best = profile
            is_converged = abs(faster - x).max() < _CONVERGENCE * faster.max()
            x = faster
            if is_converged:
                break
        if best is None:
            raise Unreachable("no timing of the path satisfies the limits, however slow")
        return best

    def _pace(self, x: Array) -> float:
        """Factor, at most one, by which the speeds of a timing keep the limits."""
        return self._strain.pace(_LIMIT_SHARE, 1.0, *self._node_values(x))

    def _node_values(self, x: Array) -> tuple[Array, Array]:
        """Values of x and y at the points in the intervals, from x at the ends of these."""
        rise = np.diff(x)
        inside = x[:-1, None] + rise[:, None] * _NODES
        return inside.ravel(), np.repeat(0.5 * rise / self._steps, len(_NODES))

    def _faster(self, x: Array) -> Array | None:
        """The largest x at every end that limits allow, linearized about ``x``, or None.

        Shares of the limits become rows by_y y + by_x x + rest, with x at the beginning of the
        interval, of which the magnitude is at most one.
        """
        (inside, y), unit = self._node_values(x), x.max()
        shares, dx, dy = self._strain.shares(inside, y), _STEP * unit, _STEP * abs(y).max()
        by_x = (self._strain.shares(inside + dx, y) - shares) / dx
        by_y = (self._strain.shares(inside, y + dy) - shares) / dy
        rest = shares - by_x * inside[:, None] - by_y * y[:, None]
        ahead = 2.0 * (self._steps[:, None] * _NODES).reshape(-1, 1)
        rows = np.array([(by_y + by_x * ahead) * unit, by_x * unit, rest]) / _LIMIT_SHARE
        rows = np.concatenate([rows, -rows], axis=2).reshape(3, len(self._steps), -1)
        scaled = _reachable(self._steps, *rows)
        return None if scaled is None else scaled * unit


def _reachable(steps: Array, by_y: Array, by_x: Array, rest: Array) -> Array | None:
    """Largest x at the ends of all intervals, from rest to rest, or None if there is none.

    Backwards, the largest x from which the end can still be reached; then forwards, as fast as
    limits allow, below that.

    Args:
        steps: Lengths of the k intervals of the path.
        by_y: Coefficients of y of m quantities that are at most one, shape (k, m).
        by_x: Coefficients of x at the beginning of the interval, likewise.
        rest: Their constant parts, likewise.

    Returns:
        Shape (k + 1,).
    """
    room = 1.0 - rest
    most = np.zeros(len(steps) + 1)
    for i in reversed(range(len(steps))):
        ahead = 2.0 * steps[i] * np.array([1.0, -1.0])  # of the next x, between zero and its most
        a, b = np.append(by_y[i], ahead), np.append(by_x[i], [1.0, -1.0])
        most[i] = _largest_x(a, b, np.append(room[i], [most[i + 1], 0.0]))
    x = np.zeros_like(most)
    if np.isnan(most).any():
        return None
    for i, step in enumerate(steps):
        is_upper = by_y[i] > 0.0
        y = np.min((room[i] - by_x[i] * x[i])[is_upper] / by_y[i][is_upper], initial=np.inf)
        x[i + 1] = max(0.0, min(x[i] + 2.0 * step * y, most[i + 1]))
    return x if np.all(x[1:] + x[:-1] > 0.0) else None


def _largest_x(a: Array, b: Array, room: Array) -> float:
    """Largest x with a y + b x ≤ room for some y, or NaN: a linear program in two variables.

    Newton's method on the gap between the lines that limit y from above and from below. It is
    concave and piecewise linear over x: each step from where it is negative goes to the root of
    the two lines in force, so there are at most as many steps as lines.
    """
    is_fixed, above, below = (a == 0.0) & (b > 0.0), a > 0.0, a < 0.0
    x = float(np.min(room[is_fixed] / b[is_fixed], initial=_LARGEST_X))
    for _ in range(len(a)):
        left = room - b * x
        upper, lower = left[above] / a[above], left[below] / a[below]
        i, j = np.flatnonzero(above)[np.argmin(upper)], np.flatnonzero(below)[np.argmax(lower)]
        gap, slope = left[i] / a[i] - left[j] / a[j], b[j] / a[j] - b[i] / a[i]
        if gap >= -_GAP_ROUNDING * sum((abs(room[k]) + abs(b[k] * x)) / abs(a[k]) for k in (i, j)):
            return x
        if slope >= 0.0:
            break
        x -= gap / slope
    return np.nan


def _grid(points: int, marks: Array) -> Array:
    """Marks from 0 to 1, and points where none is near, closer at both ends, where it is slow."""
    even = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, points + 1))
    marks = np.sort(marks)
    marks = marks[np.append(np.diff(marks) > _MARK_DISTANCE, True)]
    after = np.searchsorted(marks, even).clip(1, len(marks) - 1)
    gap = np.minimum(abs(even - marks[after - 1]), abs(even - marks[after]))
    return np.union1d(marks, even[gap > _MARK_CLEARANCE * np.gradient(even)])


def _reversals(over: Trajectory) -> Array:
    """Points of a path at which a joint reverses, hence its dry friction jumps."""
    shares = np.linspace(0.0, 1.0, _SAMPLES)
    us, _, first, _ = over.table(shares)
    direction = np.sign(first) * is_moving(first)
    i, joint = np.nonzero(direction[1:] * direction[:-1] < 0.0)
    low, high, sign = us[i], us[i + 1], direction[i, joint]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        before = over.at(middle)[1][np.arange(len(i)), joint] * sign > 0.0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return low
