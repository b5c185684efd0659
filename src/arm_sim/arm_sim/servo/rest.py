# SPDX-License-Identifier: Apache-2.0
"""Whether servos hold an arm at rest: whether all torques balance there, to rounding.

A joint that is slow is not at rest: under a soft servo it may begin to move by less than a
microradian per second squared, and still go far. What would move it is looked at instead, so that
the answer does not depend on the tick.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.actuation import StateKind
from arm_dynamics.arrays import Array
from arm_sim.plant.plant import Plant
from arm_sim.servo.law import Gains, flexibility, rigid_model

# Joints faster than this, in [rad/s] or [m/s], are not at rest.
SPEED_TOLERANCE = 1e-10
# Rounding of an acceleration, relative to what adds up to it.
ROUNDING = 100 * np.finfo(float).eps

# Function of state and command -> x', and the torques of the drives on the joints
StateRates = Callable[[Array, Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Balance:
    """A place at which the torques on an arm balance.

    Attributes:
        place: Positions and tunable quantities, as bytes.
        rounding: Rounding of the accelerations of joints, and of motors behind transmissions.
    """

    place: bytes
    rounding: Array


class Rest:
    """Balance of the torques on an arm under its servos.

    Args:
        plant: The arm.
        dt: Length of a tick in [s].
    """

    def __init__(self, plant: Plant, dt: float) -> None:
        rigid, compliance = rigid_model(plant.model), flexibility(plant.model)
        self._n, self._dt, self._gains = plant.model.n, dt, Gains.of(rigid, compliance, dt)
        self._rigid, self._dynamics = Dynamics(rigid), Dynamics(plant.model)
        self._stiffness = np.zeros_like(compliance)
        np.divide(1.0, compliance, out=self._stiffness, where=compliance > 0.0)
        self._motors, self._driven = plant.laws.places(StateKind.MOTOR_VELOCITY)
        inertias = [drive.rotor_inertia if drive else 0.0 for drive in plant.model.drives]
        self._rotor_inertia = np.array(inertias)[self._driven]

    def is_slow(self, x: Array) -> bool:
        """Whether no joint and no motor moves faster than ``SPEED_TOLERANCE``."""
        return bool(abs(self._speeds(x)).max() < SPEED_TOLERANCE)

    def rest_state(self, x: Array) -> Array:
        """The state with joints and motors at rest."""
        rest = x.copy()
        rest[self._n : 2 * self._n] = rest[self._motors] = 0.0
        return rest

    def balance(self, x: Array, command: Array, p: Array, rates: StateRates) -> Balance | None:
        """The balance of an arm at rest; None if something moves it.

        Args:
            x: State at rest, see ``rest_state``.
            command: Commands of the servos there, shape (n,).
            p: Tunable quantities, shape (np,).
            rates: Rates of the arm's state.
        """
        slope, torque = rates(x, command)
        rounding = self._rounding(x[: self._n], torque)
        balanced = (abs(self._speeds(slope)) <= rounding).all()
        return Balance(self._place(x, p), rounding) if balanced else None

    def is_balance_at(self, balance: Balance | None, x: Array, p: Array) -> bool:
        """Whether there is a balance, and it is that at these positions and quantities."""
        return balance is not None and balance.place == self._place(x, p)

    def is_balance_kept(self, balance: Balance, before: Array, after: Array) -> bool:
        """Whether an arm stayed balanced in a tick, by the states before and after it."""
        change = abs(self._speeds(after) - self._speeds(before))
        return bool((change <= self._dt * balance.rounding).all())

    def _place(self, x: Array, p: Array) -> bytes:
        return x[: self._n].tobytes() + p.tobytes()

    def _speeds(self, x: Array) -> Array:
        """Velocities of joints and of motors behind transmissions, or their rates in x'."""
        return np.concatenate([x[self._n : 2 * self._n], x[self._motors]])

    def _rounding(self, q: Array, torque: Array) -> Array:
        """Rounding of the accelerations of joints and of motors behind transmissions."""
        dynamics, gains = self._dynamics, self._gains
        scale = 1.0 + abs(q)  # of the numbers whose difference is a position error, or a twist
        load = abs(torque) + abs(dynamics.gravity(q)) + abs(dynamics.spring(q, 0.0 * q))
        load += self._stiffness * scale
        mobility = abs(np.linalg.inv(dynamics.mass_matrix(q)))
        speed = scale * gains.position  # set by the position loop
        joints = mobility @ (load + gains.damping * speed) + gains.velocity * speed
        inertia = np.diag(self._rigid.mass_matrix(q))
        motors = load + (gains.damping + inertia * gains.velocity) * speed
        return ROUNDING * np.concatenate([joints, motors[self._driven] / self._rotor_inertia])
