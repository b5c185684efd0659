# SPDX-License-Identifier: Apache-2.0
"""The fastest timing of a joint path within velocity, acceleration and torque limits.

By reachability analysis along the path (Pham and Pham, "A new approach to time-optimal path
parameterization based on reachability analysis", IEEE Trans. Robotics 34(3), 2018), implemented by
the library toppra (``pip install toppra``), which is required only here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partialmethod

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive_limits
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ArmError, InvalidInput, Unreachable
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.joint_path import JointPath, paced
from arm_dynamics.trajectory.time_scaling import torque_limits

_FREE = 1e9  # stands for no limit, since the library requires a number


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
        """The timing of rates at points; a rate of zero only at the ends."""
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
        rate = self.rates[i] + rise * since
        return float(self.us[i] + 0.5 * (self.rates[i] + rate) * since), float(rate), float(rise)

    def slower(self, stretch: float) -> Profile:
        """The same with all times multiplied by ``stretch``."""
        return Profile(self.us, self.rates / stretch, self.times * stretch)


def retimed(
    motion: JointPath,
    dynamics: Dynamics,
    limit: ArrayLike | None = None,
    acceleration: ArrayLike = np.inf,
    points: int = 200,
) -> JointPath:
    """The same path as fast as limits allow, from rest to rest.

    Accelerations jump between limits. Viscous friction and dampers, which the method ignores, and
    violations between its points are handled by slowing down the whole motion (``paced``).

    Args:
        motion: The motion; its own timing does not matter.
        dynamics: The model, with its speed limits.
        limit: Torque limits in [N m] or [N], a number or shape (n,); None for the model's.
        acceleration: Limits of joint accelerations in [rad/s²] or [m/s²], positive, likewise.
        points: Number of intervals of the path at which limits are imposed.

    Raises:
        Unreachable: If limits cannot be met at any speed.
        InvalidInput: If an argument is not allowed, or nothing limits the motion.
        ArmError: If the library is not installed.
    """
    if points < 10:
        raise InvalidInput(f"points = {points}; at least 10 are expected")
    torque = torque_limits(dynamics, limit)
    rise = positive_limits("acceleration", acceleration, dynamics.n)
    if not (np.isfinite(torque).any() or np.isfinite(rise).any()):
        raise InvalidInput("nothing limits the motion: no torque and no acceleration limit")
    us = np.linspace(0.0, 1.0, points + 1)
    rates = _rates(motion, dynamics, us, torque, rise)
    if rates is None or not np.all(rates[1:-1] > 0.0):
        raise Unreachable("no timing of the path satisfies the limits, however slow")
    quick = JointPath(motion.over, Profile.of(us, rates))
    return paced(quick, dynamics, torque, 4 * points, rise)


class _Way:
    """A path with the interface of toppra."""

    def __init__(self, motion: JointPath) -> None:
        self._motion = motion
        self.dof = motion.over.ends.shape[1]
        self.path_interval = np.array([0.0, 1.0])

    def __call__(self, us: ArrayLike, order: int = 0) -> Array:
        along: Array = self._motion.along(np.asarray(us))[order]
        return along

    eval = __call__
    evald = partialmethod(__call__, order=1)
    evaldd = partialmethod(__call__, order=2)


def _rates(
    motion: JointPath, dynamics: Dynamics, us: Array, torque: Array, rise: Array
) -> Array | None:
    """Largest du/dt at every point, or None if there is none."""
    try:
        from toppra import algorithm, constraint
    except ImportError as error:
        raise ArmError(f"the library toppra is missing ({error}); pip install toppra") from None
    between = constraint.DiscretizationType.Interpolation
    model, rigid = dynamics.model, RigidTerms(dynamics.model)
    kept = [
        constraint.JointVelocityConstraint(_both(model.velocity_limit)),
        constraint.JointAccelerationConstraint(_both(rise), between),
        constraint.JointTorqueConstraint(
            lambda q, v, a: rigid.inverse(q, v, a) + rigid.spring(q, 0.0 * v),
            _both(torque),
            model.friction.coulomb.mean,
            between,
        ),
    ]
    found = algorithm.TOPPRA(kept, _Way(motion), us, solver_wrapper="seidel")
    rates = found.compute_parameterization(0.0, 0.0)[1]
    return None if rates is None or not np.isfinite(rates).all() else np.asarray(rates)


def _both(limit: Array) -> Array:
    finite = np.where(np.isfinite(limit), limit, _FREE)
    return np.column_stack([-finite, finite])
