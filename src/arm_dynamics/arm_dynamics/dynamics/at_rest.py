# SPDX-License-Identifier: Apache-2.0
"""Accelerations where joints with dry friction are at rest: some stick, others begin to slide.

A joint sticks while its holding torque is within the static level; otherwise it slides in the
direction of the torque on it (Glocker, Set-Valued Force Laws, 2001). Joints at rest are coupled
through M: which of them slide is a linear complementarity problem, solved by pivoting. The joint
with the largest violation changes its mode until there is none; if that cycles, the first
violating joint changes instead, a rule that cannot cycle (Murty, Linear Complementarity, Linear
and Nonlinear Programming, 1988, section 4.1). Joints whose torques statics does not determine hold
together: see ``indeterminate``. The simulator does the same in C, with contacts and stops.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.gauss import constrained_motion, times
from arm_dynamics.dynamics.indeterminate import indeterminate_sets
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.loops.mass_metric import RANK

# Tolerated acceleration of a sliding joint in the wrong direction, relative to the largest.
SLACK = 1e-9
# Acceleration of a constraint that is rounding, relative to the square of the speed.
CARRYING = 1e-10
# Number of joints up to which all sets of modes may be tried.
ENUMERATED = 12

type Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Points:
    """Equations of motion of k states without friction: M a + bias + Aᵀλ = τ, A a + γ = 0.

    Attributes:
        q: Joint positions, shape (k, n).
        v: Joint velocities, shape (k, n).
        tau: Torques, shape (k, n).
        M: Mass matrices, shape (k, n, n).
        bias: C v + G + S, shape (k, n).
        A: Rows of the constraints, shape (k, m, n).
        drift: γ, shape (k, m).
        rank: Number of independent rows.
    """

    q: Array
    v: Array
    tau: Array
    M: Array
    bias: Array
    A: Array
    drift: Array
    rank: int

    def at(self, rows: NDArray[np.intp]) -> Points:
        """The states of some rows."""
        arrays = ("q", "v", "tau", "M", "bias", "A", "drift")
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})


@dataclass(frozen=True)
class MotionAtRest:
    """Motions that follow from choices of sticking joints.

    Attributes:
        a: Accelerations, exactly zero for sticking joints, shape (k, n).
        multipliers: λ, shape (k, m).
        reaction: Holding torques of sticking joints, zero for the others, shape (k, n).
    """

    a: Array
    multipliers: Array
    reaction: Array


class AtRest:
    """Joints at rest with dry friction."""

    def __init__(self, friction: SteadyFriction) -> None:
        self._friction, self._joints = friction, friction.joints

    def resting(self, v: Array) -> Flags:
        """Which joints are at rest and may stick, booleans, shape as ``v``."""
        return np.asarray((v == 0.0) & (self._joints.level > 0.0))

    def motion(self, points: Points) -> tuple[Array, Array]:
        """Motions that start from states with joints at rest.

        Returns:
            Accelerations, shape (k, n), and λ, shape (k, m).

        Raises:
            InvalidInput: If no set of sticking joints satisfies the friction laws at a point.
        """
        (k, n), m = points.v.shape, points.A.shape[1]
        a, multipliers = np.empty((k, n)), np.empty((k, m))
        directions, reversed_once = self._guess(points), np.zeros((k, n), dtype=bool)
        pending = np.arange(k)  # points at which a joint may still violate the laws
        for turn in range(3 * n + 2 ** min(n, ENUMERATED)):
            current, direction = points.at(pending), directions[pending]
            resting = self.resting(current.v)
            motion = self._moved(current, direction, resting & (direction == 0.0))
            pull = self._joints.relative_hold(motion.reaction, current.q, current.tau)
            # Violation of the friction laws by each joint at rest: not positive if satisfied.
            level, size = self._joints.level, abs(motion.a).max(axis=1, keepdims=True)
            backwards = -direction * motion.a / (1.0 + size) - SLACK
            excess = np.where(direction == 0.0, (abs(pull) - level) / level.max(), backwards)
            excess = np.where(resting, excess, 0.0)
            released = self._released(current, motion, direction, excess) if m else direction
            a[pending], multipliers[pending] = motion.a, motion.multipliers
            directions[pending] = released
            violating = np.flatnonzero((excess > 0.0).any(axis=1))
            if not len(violating):
                return a, multipliers
            begins = (released != direction)[violating].any(axis=1)
            pending, violating = pending[violating], violating[~begins]
            order = excess[violating] > 0.0 if turn >= 3 * n else excess[violating]
            joint = np.argmax(order, axis=1)
            # The modes of these entries change: they begin to slide, reverse, or stick.
            entry = pending[~begins], joint
            held, turns = directions[entry] == 0.0, ~reversed_once[entry] & (m > 0)
            otherwise = np.where(turns, -directions[entry], 0.0)
            reversed_once[entry] = ~held & turns
            directions[entry] = np.where(held, np.sign(pull[violating, joint]), otherwise)
        raise InvalidInput(
            "no set of sticking joints satisfies the friction laws: the motion is not determined"
        )

    def _released(
        self, points: Points, motion: MotionAtRest, direction: Array, excess: Array
    ) -> Array:
        """Directions after all that holds together and is beyond its limits has been released.

        The violation of joints that hold together becomes zero where they hold, and multipliers
        those with which they do.
        """
        signs = np.ones_like(direction), -np.ones_like(direction)
        bears = np.stack([self._joints.most_held(s, points.q, points.tau) for s in signs])
        released = direction.copy()
        for k in np.flatnonzero(((direction == 0.0) & (excess > 0.0)).any(axis=1)):
            held = self.resting(points.v[k]) & (direction[k] == 0.0)
            for each in indeterminate_sets(points.A[k], held, motion.reaction[k], bears[:, k]):
                motion.multipliers[k] += each.multipliers
                excess[k, each.joints] = 0.0 if each.holds else 1.0
                released[k, each.joints] = each.direction
        return released

    def _guess(self, points: Points) -> Array:
        """Initial modes: joints at rest stick, except those that a moving loop takes along."""
        direction, resting = np.sign(points.v), self.resting(points.v)
        carried = np.zeros_like(resting)
        if points.A.shape[1]:
            for k in np.flatnonzero(points.v.any(axis=1)):
                carried[k] = _carried(points.A[k], points.drift[k], points.v[k], resting[k])
        if carried.any():
            forwards = np.where(carried, 1.0, direction)
            a = self._moved(points, forwards, resting & ~carried).a
            direction = np.where(carried, np.sign(a), direction)
        return direction

    def _moved(self, points: Points, direction: Array, held: Flags) -> MotionAtRest:
        """Motions in which ``held`` joints stick and the others slide in ``direction``."""
        sliding, (q, v, tau) = ~held, (points.q, points.v, points.tau)
        load = tau - points.bias - self._friction(v, direction, q, tau)
        moving = sliding[:, :, None] & sliding[:, None, :]
        M = np.where(moving, points.M, 0.0) + np.eye(v.shape[1]) * held[:, None, :]
        A, forces = points.A * sliding[:, None, :], load * sliding
        if A.shape[1]:
            a, multipliers = constrained_motion(M, forces, A, points.drift, points.rank)
        else:
            a, multipliers = np.linalg.solve(M, forces[..., None])[..., 0], points.drift
        a = a * sliding
        reaction = load - times(points.M, a) - times(np.swapaxes(points.A, 1, 2), multipliers)
        return MotionAtRest(a, multipliers, held * reaction)


def _carried(A: Array, drift: Array, v: Array, resting: Flags) -> Flags:
    """Joints at rest without whose acceleration the constraints could not be satisfied."""
    size = abs(A).max(axis=1)
    rows, required = A / np.where(size > 0.0, size, 1.0)[:, None], drift / np.maximum(size, 1e-300)
    carried = np.zeros_like(resting)
    while True:
        moving = rows[:, ~resting | carried]
        left = required - moving @ np.linalg.lstsq(moving, required, rcond=RANK)[0]
        if abs(left).max() <= CARRYING * float(abs(v).max()) ** 2:
            return carried
        further = resting & ~carried & (abs(rows.T @ left) > CARRYING * abs(left).max())
        if not further.any():
            return carried
        carried |= further
