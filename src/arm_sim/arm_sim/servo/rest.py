# SPDX-License-Identifier: Apache-2.0
"""Whether servos hold an arm at rest: whether all torques balance there, to rounding.

A joint that is slow is not at rest: under a soft servo it may begin to move by less than a
microradian per second squared, and still go far. What would move it is looked at instead, so that
the answer does not depend on the tick.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.actuation import StateKind
from arm_dynamics.arrays import Array
from arm_sim.plant.plant import Plant
from arm_sim.servo.law import Gains, flexibility, rigid_model

# Joints faster than this, in [rad/s] or [m/s], are not at rest.
AT_REST = 1e-10
# Rounding of an acceleration, relative to what adds up to it.
ROUNDING = 100 * np.finfo(float).eps

Slope = Callable[[Array, Array], tuple[Array, Array]]
"""Function of state and command -> x', and the torques of the drives on the joints."""


class Rest:
    """Balance of the torques on an arm under its servos.

    Args:
        plant: The arm.
        dt: Length of a tick in [s].
    """

    def __init__(self, plant: Plant, dt: float) -> None:
        rigid = rigid_model(plant.model)
        soft = flexibility(plant.model)
        self._gains = Gains.of(rigid, soft, dt)
        self._n, self._rigid = plant.model.n, Dynamics(rigid)
        self._dynamics = Dynamics(plant.model)
        self._stiffness = np.divide(1.0, soft, out=np.zeros_like(soft), where=soft > 0.0)
        states = plant.laws.states
        turning = [
            (k, state.joint)
            for k, state in enumerate(states, 2 * self._n)
            if state.kind is StateKind.MOTOR_VELOCITY
        ]
        self._places, self._joints = np.array(turning, dtype=int).reshape(-1, 2).T
        inertias = [drive.rotor_inertia if drive else 0.0 for drive in plant.model.drives]
        self._inertia = np.array(inertias)[self._joints]
        self._dt = dt
        self._known: tuple[bytes, Array] = (b"", np.zeros(0))

    def slow(self, x: Array) -> bool:
        """Whether no joint and no motor moves faster than ``AT_REST``."""
        return bool(abs(self._speeds(x)).max() < AT_REST)

    def stopped(self, x: Array) -> Array:
        """The state with joints and motors at rest."""
        still = x.copy()
        still[self._n : 2 * self._n] = still[self._places] = 0.0
        return still

    def balanced(self, x: Array, command: Array, p: Array, slope: Slope) -> bool:
        """Whether nothing moves an arm at rest.

        Args:
            x: State at rest, see ``stopped``.
            command: Commands of the servos there, shape (n,).
            p: Tunable quantities, shape (np,).
            slope: What the arm does.
        """
        rates, torque = slope(x, command)
        rounding = self._rounding(x[: self._n], torque)
        self._known = self._key(x, p), rounding
        return bool((abs(self._speeds(rates)) <= rounding).all())

    def knows(self, x: Array, p: Array) -> bool:
        """Whether ``balanced`` was asked for these positions and quantities last."""
        return self._known[0] == self._key(x, p)

    def stays(self, before: Array, after: Array) -> bool:
        """Whether an arm known to be balanced was still so in a tick, by what it did."""
        gained = abs(self._speeds(after) - self._speeds(before))
        return bool((gained <= self._dt * self._known[1]).all())

    def _key(self, x: Array, p: Array) -> bytes:
        return x[: self._n].tobytes() + p.tobytes()

    def _speeds(self, x: Array) -> Array:
        """Velocities of joints and of motors behind transmissions, or their rates in x'."""
        return np.concatenate([x[self._n : 2 * self._n], x[self._places]])

    def _rounding(self, q: Array, torque: Array) -> Array:
        """Rounding of the accelerations of joints and of motors behind transmissions."""
        dynamics, gains, place = self._dynamics, self._gains, 1.0 + abs(q)
        load = abs(torque) + abs(dynamics.gravity(q)) + abs(dynamics.spring(q, 0.0 * q))
        load += self._stiffness * place
        mobility = abs(np.linalg.inv(dynamics.mass_matrix(q)))
        position = place * gains.ratio
        joints = mobility @ (load + gains.damping * position) + gains.rate * position
        inertia = np.diag(self._rigid.mass_matrix(q))
        driven = load + (gains.damping + inertia * gains.rate) * position
        return ROUNDING * np.concatenate([joints, driven[self._joints] / self._inertia])
