# SPDX-License-Identifier: Apache-2.0
"""What a motion demands of an arm, and how much slower it must be to stay within all limits.

Slower by s, velocities shrink by 1/s and accelerations by 1/s², so torques without friction are
G + S + (M a + C v)/s², known for every speed from one evaluation of inverse dynamics (Hollerbach,
"Dynamic scaling of manipulator trajectories", ASME J. Dyn. Sys. Meas. Control 106, 1984). Friction
and the motors' voltages follow from them. Limits hold at every instant, not at points: a motion is
looked at ever more closely until what may lie between two points is below ``OVERSHOOT``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.arrays import Array, each, positive_limits
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.limits import Limits

# Fraction of a limit by which a quantity may exceed its largest value at the points found by
# ``refined_shares``; scaled motions keep away from their limits by twice as much.
OVERSHOOT = 1e-5
_NODES = np.array([1e-6, 0.25, 0.5, 0.75, 1.0 - 1e-6])  # inside: values may jump at the ends
_HALVINGS = 14  # of an interval, then a jump in it is seen from both sides
_LARGEST_COUNT = 100_000  # intervals at a time
_ROUNDS = 20  # of slowing down and looking again, at most
_REST_SHARE = 1e-9  # fraction of the fastest joint's speed below which a velocity is rounding
_ROOT_ERROR = 1e-13  # relative error of a root
_ZERO = 1e-50  # squares of speeds, and square roots of limits, that are zero


class Capacity:
    """Limits of an arm's joints and of their motors.

    Args:
        dynamics: The model; used from one thread only.
        effort: Limits of torques in [N m] or [N], inf for none, shape (n,). Limits of the motors'
            currents and voltages, hence their torque-speed curves, hold in any case.
        velocity: Limits of speeds in [rad/s] or [m/s], likewise; None for none.
        acceleration: Limits of accelerations in [rad/s²] or [m/s²], likewise.

    Attributes:
        columns: Quantity (``velocity``, ``acceleration``, ``effort`` or ``voltage``) and joint of
            every limit that there is.
        limits: These limits, shape (m,).
    """

    def __init__(
        self,
        dynamics: Dynamics,
        effort: Array,
        velocity: Array | None = None,
        acceleration: Array | None = None,
    ) -> None:
        self.dynamics, self.rigid = dynamics, RigidTerms(dynamics.model)
        unlimited = np.full(dynamics.n, np.inf)
        self._resistance, self._emf = np.zeros((2, dynamics.n))
        current, voltage = unlimited.copy(), unlimited.copy()
        for i, drive in enumerate(dynamics.model.drives):
            if drive is None:
                continue
            motor, constant = drive.motor, drive.torque_constant
            current[i] = drive.current_torque
            if motor.voltage_limit is not None and motor.resistance is not None:
                voltage[i] = motor.voltage_limit
                self._resistance[i] = motor.resistance / constant
                self._emf[i] = drive.back_emf_constant
        by_quantity = {
            "velocity": unlimited if velocity is None else velocity,
            "acceleration": unlimited if acceleration is None else acceleration,
            "effort": np.minimum(effort, current),
            "voltage": voltage,
        }
        limits = np.concatenate(list(by_quantity.values()))
        self._is_limited = np.isfinite(limits)
        names = [(quantity, joint) for quantity in by_quantity for joint in range(dynamics.n)]
        self.columns = [names[i] for i in np.flatnonzero(self._is_limited)]
        self.limits = limits[self._is_limited]

    @classmethod
    def of(cls, dynamics: Dynamics, limit: ArrayLike | None, acceleration: ArrayLike) -> Capacity:
        """The arm's limits of speeds, and these of torques and accelerations.

        Args:
            dynamics: The model; used from one thread only.
            limit: Limits of torques, positive, a number or shape (n,); None for the model's.
            acceleration: Limits of accelerations, likewise.
        """
        model, rise = dynamics.model, positive_limits("acceleration", acceleration, dynamics.n)
        effort = model.effort_limit if limit is None else positive_limits("limit", limit, model.n)
        return cls(dynamics, effort, model.velocity_limit, rise)

    def shares(self, q: Array, v: Array, a: Array, tau: Array) -> Array:
        """Signed shares of the limits that a motion with joint torques tau uses, shape (k, m)."""
        motors = self.dynamics.command_map.of_motors(q, v, a, tau)
        values = (v, a, motors, self._resistance * motors + self._emf * v)
        limits = np.fmax(self.limits, _ZERO**2)
        return np.asarray(np.concatenate(values, axis=1)[:, self._is_limited] / limits)


class Strain:
    """Shares of its limits that an arm needs at points of a path, for every timing.

    Along q(u), with x = (du/dt)² and y = d²u/dt², q̇ = q' √x and q̈ = q'' x + q' y.

    Args:
        capacity: The limits.
        q: Positions at k points, shape (k, n).
        first: Derivatives q', likewise.
        second: Derivatives q'', likewise.
        sliding: Direction of each joint for dry friction, likewise; None for the sign of q'.
    """

    def __init__(
        self, capacity: Capacity, q: Array, first: Array, second: Array,
        sliding: Array | None = None,
    ) -> None:  # fmt: skip
        self._capacity, self._q, self._first, self._second = capacity, q, first, second
        self._still, self._inverse = np.zeros_like(q), partial(each, capacity.rigid.inverse)
        self._sliding = np.sign(first) * is_moving(first) if sliding is None else sliding
        self._weight = self._inverse(q, self._still, self._still)
        self._by_x = self._inverse(q, first, second) - self._weight

    @cached_property
    def _by_y(self) -> Array:
        return self._inverse(self._q, self._still, self._first) - self._weight

    def shares(self, x: ArrayLike, y: ArrayLike | None = None) -> Array:
        """Signed shares, shape (k, m), for x and y in [1/s²], numbers or shape (k,)."""
        x = np.reshape(x, (-1, 1))
        v, a, tau = self._first * np.sqrt(x), self._second * x, self._weight + self._by_x * x
        if y is not None:
            y = np.reshape(y, (-1, 1))
            a, tau = a + self._first * y, tau + self._by_y * y
        dynamics = self._capacity.dynamics
        if dynamics.model.springs:
            tau = tau + each(self._capacity.rigid.spring, self._q, v)
        friction = dynamics.steady_friction
        tau = friction.overcome(tau, v, self._sliding if friction.has_dry else v, self._q)
        return self._capacity.shares(self._q, v, a, tau)

    def pace(
        self, allowed: float = 1.0, most: float = 1.0, x: ArrayLike = 1.0,
        y: ArrayLike | None = None,
    ) -> float:  # fmt: skip
        """Factor of the speed of a timing at which no share exceeds ``allowed``.

        Args:
            allowed: Largest share.
            most: Largest factor.
            x: (du/dt)², see ``shares``, for the timing at a factor of one.
            y: d²u/dt², likewise; None for zero.

        Raises:
            Unreachable: If gravity, springs and dry friction alone exceed it at any speed, or a
                limit is zero.
        """

        def excess(scale: float) -> float:
            used = self.shares(scale * np.asarray(x), None if y is None else scale * np.asarray(y))
            return float(abs(used).max(initial=0.0)) - allowed

        if (high := excess(most**2)) <= 0.0:
            return most
        if (low := excess(0.0)) >= 0.0:
            raise self._overload(allowed)
        if (scale := _root(excess, (0.0, low), (most**2, high))) < _ZERO:
            raise Unreachable("a joint that moves has a limit of zero, so it may not move at all")
        return float(np.sqrt(scale))

    def _overload(self, allowed: float) -> Unreachable:
        shares = abs(self.shares(0.0))
        i, column = np.unravel_index(np.argmax(shares), shares.shape)
        (quantity, joint), limit = self._capacity.columns[column], self._capacity.limits[column]
        dynamics, need = self._capacity.dynamics, float(shares[i, column] * limit)
        parts = "weight, springs" if dynamics.model.springs else "weight"
        unit = Limits.of(dynamics.model).unit(joint, quantity)
        return Unreachable(
            f"{parts} and dry friction of joint '{dynamics.joint_names[joint]}' take "
            f"{need:.4g}{unit} along the motion at any pace; its limit is {limit:.4g}{unit}",
            max(0.0, need - allowed * limit),
        )


def is_moving(first: Array) -> NDArray[np.bool_]:
    """Joints that move along a path, apart from rounding, by derivatives of shape (k, n)."""
    size = abs(first)
    return np.asarray(size > _REST_SHARE * size.max(axis=1, keepdims=True))


def slowdown(
    capacity: Capacity, sample: Callable[[Array], tuple[Array, Array, Array]], edges: Array
) -> float:
    """Time-scaling factor, at least one, that keeps a motion within limits at every instant.

    Args:
        capacity: The limits.
        sample: Positions, velocities and accelerations at times, each of shape (k, n).
        edges: Times in [s] between which the motion is looked at, increasing; at best those
            where accelerations jump.

    Raises:
        Unreachable: If gravity, springs and dry friction alone exceed a limit.
    """
    pace = 1.0
    for _ in range(_ROUNDS):

        def shares(times: Array, pace: float = pace) -> Array:
            return Strain(capacity, *sample(times)).shares(pace**2)

        times, values = refined_shares(shares, edges)
        if abs(values).max(initial=0.0) <= 1.0 - OVERSHOOT:
            return 1.0 / pace
        pace = Strain(capacity, *sample(times)).pace(1.0 - 2.0 * OVERSHOOT, pace)
    raise Unreachable("no pace of the motion keeps the limits")


def refined_shares(shares: Callable[[Array], Array], edges: Array) -> tuple[Array, Array]:
    """Times between which no share of a limit rises further than by ``OVERSHOOT``.

    Intervals are halved where a share, or the parabola through its values, could exceed one and
    the largest value found so far. It may curve twice as strongly as its second differences. In
    the end, intervals are so short that a jump lies in them, and its two sides are seen.

    Args:
        shares: Signed shares at times, shape (k, m).
        edges: Times in [s] at which it begins.

    Returns:
        Times, shape (k,), and shares there.
    """
    low, high = edges[:-1], edges[1:]
    times, values, top = [], [], 1.0
    for _ in range(_HALVINGS):
        at = low[:, None] + (high - low)[:, None] * _NODES
        used = shares(at.ravel()).reshape(*at.shape, -1)
        times.append(at.ravel())
        values.append(used.reshape(at.size, -1))
        peak = abs(used).max(axis=(1, 2), initial=0.0)
        rise = abs(np.diff(used, 2, axis=1)).max(axis=(1, 2), initial=0.0) / 4.0
        top = max(top, float(peak.max(initial=0.0)))
        doubtful = (peak + rise > top) & (rise > OVERSHOOT * top)
        if not doubtful.any():
            break
        if doubtful.sum() > _LARGEST_COUNT:
            raise InvalidInput(
                f"the motion bends in more than {_LARGEST_COUNT} places, too many to check its "
                "limits; allowed: smooth motions"
            )
        low, high = low[doubtful], high[doubtful]
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    order = np.argsort(np.concatenate(times), kind="stable")
    return np.concatenate(times)[order], np.concatenate(values)[order]


def _root(
    excess: Callable[[float], float], low: tuple[float, float], high: tuple[float, float]
) -> float:
    """Largest x at which a function has not risen above zero, between two points (Illinois)."""
    (a, below), (b, above) = low, high
    last = 0.0
    for _ in range(100):
        step = _ROOT_ERROR * b
        if b - a <= 2.0 * step:
            break
        x = min(max((a * above - b * below) / (above - below), a + step), b - step)
        value = excess(x)
        again = value * last > 0.0
        if value > 0.0:
            b, above, below = x, value, 0.5 * below if again else below
        else:
            a, below, above = x, value, 0.5 * above if again else above
        last = value
    return a
