# SPDX-License-Identifier: Apache-2.0
"""Check of a trajectory against limits: which joint violates which limit first, and when.

Positions, velocities and accelerations are polynomials, so their extremes are exact. Torques and
motors' voltages are computed at points of every segment, and at more of them where they might
exceed a limit in between by more than ``timing.scaling.OVERSHOOT`` of it.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.quintics import extremes
from arm_dynamics.trajectory.timing.scaling import OVERSHOOT, Capacity, Strain, refined_shares
from arm_dynamics.trajectory.trajectory import Trajectory
from arm_dynamics.trajectory.waypoints import segment_excess

_ROUNDING = 1e-9  # up to which values beyond a limit, or a jump of velocities, are rounding
_POINTS = 60  # smallest number of points at which torques are computed
_QUANTITIES = ("position", "velocity", "acceleration")


@frozen
class Excess:
    """The first violation of a limit by a trajectory.

    Attributes:
        joint: Index of the joint.
        quantity: ``position``, ``velocity``, ``acceleration``, ``effort`` or ``voltage``.
        time: Time in [s] from the trajectory's start.
        peak: Extreme value that the joint reaches.
        limit: The limit, with its sign.
    """

    joint: int
    quantity: str
    time: float
    peak: float
    limit: float


@frozen
class Bounds:
    """Limits of a trajectory.

    Attributes:
        limits: Limits of positions, velocities and accelerations.
        dynamics: The model for its torques and the voltages of its motors, or None to leave them
            unchecked; used from one thread only.
        margin: Fraction by which limits of velocity, acceleration, torque and voltage may be
            exceeded.
    """

    limits: Limits
    dynamics: Dynamics | None = None
    margin: float = 0.0

    def check(
        self, trajectory: Trajectory, late: float = 0.0, before: Array | None = None
    ) -> None:
        """Check a trajectory.

        Args:
            trajectory: The trajectory.
            late: The user's time in [s] at its start, for messages.
            before: Velocities just before it, shape (n,); None for rest.

        Raises:
            InvalidInput: If it violates a limit; the message names the joint, the time and the
                limit.
        """
        still = np.zeros(trajectory.ends.shape[1])
        excesses = [
            *self._range_violations(trajectory),
            *self._velocity_jumps(trajectory, still if before is None else before),
            *self._effort_violations(trajectory),
        ]
        if not excesses:
            return
        first = min(excesses, key=lambda x: x.time)
        name, unit = self.limits.name(first.joint), self.limits.unit(first.joint, first.quantity)
        margin = self.margin if first.quantity != "position" else 0.0
        more = f" and {100.0 * margin:.3g} % more (limit_margin)" if margin else ""
        raise InvalidInput(
            f"joint '{name}' would leave its {first.quantity} limit at {first.time + late:.3f} s "
            f"and reach {first.peak:.4g}{unit}; allowed: "
            f"{first.limit / (1.0 + margin):.4g}{unit}{more}"
        )

    def factor(self, trajectory: Trajectory) -> float:
        """Factor by which a trajectory must be slowed down, at least one; its start is unchanged.

        Raises:
            Unreachable: If gravity and friction alone exceed a limit.
        """
        peaks = extremes(trajectory.coefficients)
        slower = max(1.0, float(segment_excess(trajectory, peaks, self._widened).max()))
        if (capacity := self._capacity) is not None:
            times, shares = self._strains(capacity, trajectory)
            if abs(shares).max(initial=0.0) > 1.0 + _ROUNDING:
                allowed = (1.0 + self.margin) * (1.0 - 2.0 * OVERSHOOT)
                slower = max(slower, 1.0 / Strain(capacity, *trajectory.at(times)).pace(allowed))
        return slower if slower > 1.0 + _ROUNDING else 1.0

    def _range_violations(self, trajectory: Trajectory) -> Iterator[Excess]:
        """The first time at which each joint exceeds each of its limits."""
        wide, start = self._widened, trajectory.ends[0]
        # An arm that is already beyond a position limit may return from there.
        lower = np.minimum(wide.lower, start), -wide.velocity, -wide.acceleration
        upper = np.maximum(wide.upper, start), wide.velocity, wide.acceleration
        h = np.diff(trajectory.times)[:, None]
        scale = np.stack((np.ones_like(h), 1.0 / h, 1.0 / h**2))
        least, most = extremes(trajectory.coefficients) * scale
        for order, high in ((k, high) for k in range(3) for high in (False, True)):
            bound = (upper if high else lower)[order]
            reached = (most if high else least)[order]
            over = reached > bound + _ROUNDING if high else reached < bound - _ROUNDING
            for joint in np.flatnonzero(over.any(axis=0)):
                segment = int(np.argmax(over[:, joint]))
                peak = float((reached.max(axis=0) if high else reached.min(axis=0))[joint])
                edge = float(bound[joint])
                time = _crossing(trajectory, segment, int(joint), order, edge, high)
                yield Excess(int(joint), _QUANTITIES[order], time, peak, edge)

    @cached_property
    def _widened(self) -> Limits:
        """The limits with the margin of velocities and accelerations."""
        limits, factor = self.limits, 1.0 + self.margin
        speed, rise = limits.velocity * factor, limits.acceleration * factor
        return replace(limits, velocity=speed, acceleration=rise)

    def _velocity_jumps(self, trajectory: Trajectory, before: Array) -> Iterator[Excess]:
        """Velocities that jump between segments, which no acceleration allows."""
        bound = self._widened.acceleration
        if not np.isfinite(bound).any():
            return
        ends = trajectory.at_shares(np.array([0.0, 1.0]))[:, 1]  # velocities, (w − 1, n, 2)
        incoming = np.vstack((before[None], ends[:, :, 1]))
        outgoing = np.vstack((ends[:, :, 0], np.zeros_like(before)[None]))
        over = (np.abs(outgoing - incoming) > _ROUNDING) & np.isfinite(bound)
        for joint in np.flatnonzero(over.any(axis=0)):
            time = float(trajectory.times[int(np.argmax(over[:, joint]))])
            yield Excess(int(joint), "acceleration", time, np.inf, float(bound[joint]))

    def _effort_violations(self, trajectory: Trajectory) -> Iterator[Excess]:
        """The first time at which a torque or a voltage is too large."""
        if (capacity := self._capacity) is None:
            return
        times, shares = self._strains(capacity, trajectory)
        over = abs(shares) > 1.0 + _ROUNDING
        if over.any():
            i = int(np.argmax(over.any(axis=1)))
            column = int(np.argmax(over[i]))
            quantity, joint = capacity.columns[column]
            limit = float(capacity.limits[column]) * (1.0 + self.margin)
            peak = float(shares[np.argmax(abs(shares[:, column])), column])
            yield Excess(joint, quantity, float(times[i]), peak * limit, np.copysign(limit, peak))

    @cached_property
    def _capacity(self) -> Capacity | None:
        """Limits of torques and voltages; None if there are none."""
        if self.dynamics is None:
            return None
        capacity = Capacity(self.dynamics, self.dynamics.model.effort_limit)
        return capacity if capacity.columns else None

    def _strains(self, capacity: Capacity, trajectory: Trajectory) -> tuple[Array, Array]:
        """Times, and shares of these limits, widened by the margin; see ``refined_shares``."""
        segments = len(trajectory.times) - 1
        parts = segments * max(1, _POINTS // (4 * segments)) if segments else 0
        edges = np.interp(
            np.linspace(0.0, segments, parts + 1), np.arange(segments + 1), trajectory.times
        )

        def shares(times: Array) -> Array:
            strain = Strain(capacity, *trajectory.at(times))
            return strain.shares(1.0) / (1.0 + self.margin)

        return refined_shares(shares, edges)


def _crossing(
    trajectory: Trajectory, segment: int, joint: int, order: int, bound: float, high: bool
) -> float:
    """Time at which a joint first exceeds a bound within a segment, in [s]."""
    start, end = trajectory.times[segment : segment + 2]
    polynomial = np.polynomial.Polynomial(trajectory.coefficients[segment, joint])
    course = polynomial.deriv(order) if order else polynomial
    course = course / (end - start) ** order - bound
    if (course(0.0) > _ROUNDING) if high else (course(0.0) < -_ROUNDING):
        return float(start)
    roots = course.roots()
    real = roots.real[(np.abs(roots.imag) < 1e-7) & (roots.real >= 0.0) & (roots.real <= 1.0)]
    return float(start + (end - start) * real.min(initial=1.0))
