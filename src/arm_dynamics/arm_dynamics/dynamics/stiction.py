# SPDX-License-Identifier: Apache-2.0
"""Accelerations where joints with dry friction are at rest: some stick, others begin to slide.

A joint sticks while its holding torque is within the static level; otherwise it slides in the
direction of the torque on it (Glocker, Set-Valued Force Laws, 2001). Joints at rest are coupled
through M: which of them slide is a linear complementarity problem, solved by pivoting. The joint
with the largest violation changes its mode until there is none; if that cycles, the first
violating joint changes instead, a rule that cannot cycle (Murty, Linear Complementarity, Linear
and Nonlinear Programming, 1988, section 4.1). Joints whose torques statics does not determine hold
together: see ``indeterminate_sets``. The simulator does the same in C, with contacts and stops.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.gauss import constrained_motion, times
from arm_dynamics.dynamics.indeterminate_sets import indeterminate_sets
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.loops.mass_metric import RANK

# Tolerated acceleration of a sliding joint in the wrong direction, relative to the largest.
REVERSAL_TOLERANCE = 1e-9
# Acceleration of a constraint that is rounding, relative to the square of the speed.
CARRY_TOLERANCE = 1e-10
# Number of joints up to which all sets of modes may be tried.
LARGEST_ENUMERATION = 12

type Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class States:
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

    def at(self, rows: NDArray[np.intp]) -> States:
        """The states of some rows."""
        arrays = ("q", "v", "tau", "M", "bias", "A", "drift")
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})


@dataclass(frozen=True)
class StickingMotion:
    """Motions that follow from choices of sticking joints.

    Attributes:
        a: Accelerations, exactly zero for sticking joints, shape (k, n).
        multipliers: λ, shape (k, m).
        reaction: Holding torques of sticking joints, zero for the others, shape (k, n).
    """

    a: Array
    multipliers: Array
    reaction: Array


class Stiction:
    """Joints at rest with dry friction."""

    def __init__(self, friction: SteadyFriction) -> None:
        self._friction, self._joints = friction, friction.joints

    def resting(self, v: Array) -> Flags:
        """Which joints are at rest and may stick, booleans, shape as ``v``."""
        return np.asarray((v == 0.0) & (self._joints.level > 0.0))

    def motion(self, states: States) -> tuple[Array, Array]:
        """Motions that start from states with joints at rest.

        Returns:
            Accelerations, shape (k, n), and λ, shape (k, m).

        Raises:
            InvalidInput: If no set of sticking joints satisfies the friction laws at a point.
        """
        (k, n), m = states.v.shape, states.A.shape[1]
        a, multipliers = np.empty((k, n)), np.empty((k, m))
        directions, reversed_once = self._initial_directions(states), np.zeros((k, n), dtype=bool)
        pending = np.arange(k)  # points at which a joint may still violate the laws
        for iteration in range(3 * n + 2 ** min(n, LARGEST_ENUMERATION)):
            current, direction = states.at(pending), directions[pending]
            resting = self.resting(current.v)
            motion = self._motion(current, direction, resting & (direction == 0.0))
            pull = self._joints.relative_hold(motion.reaction, current.q, current.tau)
            # Violation of the friction laws by each joint at rest: not positive if satisfied.
            level, size = self._joints.level, abs(motion.a).max(axis=1, keepdims=True)
            backwards = -direction * motion.a / (1.0 + size) - REVERSAL_TOLERANCE
            excess = np.where(direction == 0.0, (abs(pull) - level) / level.max(), backwards)
            excess = np.where(resting, excess, 0.0)
            released = self._release_sets(current, motion, direction, excess) if m else direction
            a[pending], multipliers[pending] = motion.a, motion.multipliers
            directions[pending] = released
            violating = np.flatnonzero((excess > 0.0).any(axis=1))
            if not len(violating):
                return a, multipliers
            is_released = (released != direction)[violating].any(axis=1)
            pending, violating = pending[violating], violating[~is_released]
            order = excess[violating] > 0.0 if iteration >= 3 * n else excess[violating]
            joint = np.argmax(order, axis=1)
            # The modes of these entries change: they begin to slide, reverse, or stick.
            entry = pending[~is_released], joint
            sticking, reverses = directions[entry] == 0.0, ~reversed_once[entry] & (m > 0)
            otherwise = np.where(reverses, -directions[entry], 0.0)
            reversed_once[entry] = ~sticking & reverses
            directions[entry] = np.where(sticking, np.sign(pull[violating, joint]), otherwise)
        raise InvalidInput(
            "no set of sticking joints satisfies the friction laws: the motion is not determined"
        )

    def _release_sets(
        self, states: States, motion: StickingMotion, direction: Array, excess: Array
    ) -> Array:
        """Directions after all that holds together and is beyond its limits has been released.

        The violation of joints that hold together becomes zero where they hold, and multipliers
        those with which they do.
        """
        signs = np.ones_like(direction), -np.ones_like(direction)
        bearing = np.stack([self._joints.most_held(s, states.q, states.tau) for s in signs])
        released = direction.copy()
        for k in np.flatnonzero(((direction == 0.0) & (excess > 0.0)).any(axis=1)):
            sticking = self.resting(states.v[k]) & (direction[k] == 0.0)
            reaction, limits = motion.reaction[k], bearing[:, k]
            for group in indeterminate_sets(states.A[k], sticking, reaction, limits):
                motion.multipliers[k] += group.multipliers
                excess[k, group.joints] = 0.0 if group.holds else 1.0
                released[k, group.joints] = group.direction
        return released

    def _initial_directions(self, states: States) -> Array:
        """Initial modes: joints at rest stick, except those that a moving loop takes along."""
        direction, resting = np.sign(states.v), self.resting(states.v)
        carried = np.zeros_like(resting)
        if states.A.shape[1]:
            for k in np.flatnonzero(states.v.any(axis=1)):
                carried[k] = _carried(states.A[k], states.drift[k], states.v[k], resting[k])
        if carried.any():
            forwards = np.where(carried, 1.0, direction)
            a = self._motion(states, forwards, resting & ~carried).a
            direction = np.where(carried, np.sign(a), direction)
        return direction

    def _motion(self, states: States, direction: Array, sticking: Flags) -> StickingMotion:
        """Motions in which the ``sticking`` joints stick and the others slide in ``direction``."""
        sliding, (q, v, tau) = ~sticking, (states.q, states.v, states.tau)
        load = tau - states.bias - self._friction(v, direction, q, tau)
        moving = sliding[:, :, None] & sliding[:, None, :]
        M = np.where(moving, states.M, 0.0) + np.eye(v.shape[1]) * sticking[:, None, :]
        A, forces = states.A * sliding[:, None, :], load * sliding
        if A.shape[1]:
            a, multipliers = constrained_motion(M, forces, A, states.drift, states.rank)
        else:
            a, multipliers = np.linalg.solve(M, forces[..., None])[..., 0], states.drift
        a = a * sliding
        reaction = load - times(states.M, a) - times(np.swapaxes(states.A, 1, 2), multipliers)
        return StickingMotion(a, multipliers, sticking * reaction)


def _carried(A: Array, drift: Array, v: Array, resting: Flags) -> Flags:
    """Joints at rest without whose acceleration the constraints could not be satisfied."""
    size = abs(A).max(axis=1)
    rows, required = A / np.where(size > 0.0, size, 1.0)[:, None], drift / np.maximum(size, 1e-300)
    carried = np.zeros_like(resting)
    while True:
        moving = rows[:, ~resting | carried]
        residual = required - moving @ np.linalg.lstsq(moving, required, rcond=RANK)[0]
        if abs(residual).max() <= CARRY_TOLERANCE * float(abs(v).max()) ** 2:
            return carried
        effect = abs(rows.T @ residual)
        added = resting & ~carried & (effect > CARRY_TOLERANCE * abs(residual).max())
        if not added.any():
            return carried
        carried |= added
