# SPDX-License-Identifier: Apache-2.0
"""Laws with states of their own, between the command u and the torque at the joints.

The rigid arm has the states q and v. A motor adds a current, a belt the angle of its motor, a
bristle its deflection: such a law brings states z of its own, says how they change, and what it
stores, takes in and loses. The simulator integrates x = (q, v, z).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, Self

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.model.arm import ArmModel


@dataclass(frozen=True)
class Flow:
    """What a law does at an instant.

    Attributes:
        torque: What it adds on the link side of each joint in [N m] or [N], shape (n,).
        slope: Rate of change of its states, shape (nz,).
        stored: Energy that it stores in [J]: elastic, magnetic, of rotors that M does not hold; it
            follows from q, v and its states.
        supplied: Power that it takes from outside in [W], such as voltage times current.
        lost: Power that it turns into heat in [W].
    """

    torque: ca.SX
    slope: ca.SX
    stored: ca.SX | float = 0.0
    supplied: ca.SX | float = 0.0
    lost: ca.SX | float = 0.0


class StatefulLaw(Protocol):
    """A law with states of its own (perhaps none), or one that takes the place of the command.

    Attributes:
        title: What it is, for display: "LuGre friction".
        names: Its states, for display, with joint and unit: "joint1 motor current [A]".
        scale: For each state the size that matters, shape (nz,): an error of the tolerance times
            this size is as bad as that of a radian.
        replaces_command: Joints for which its torque takes the place of u, shape (n,); for the
            others u acts directly.
    """

    title: str
    names: tuple[str, ...]
    scale: Array
    replaces_command: NDArray[np.bool_]

    def initial(self, q: Array, v: Array) -> Array:
        """Its states when the arm is put to q, v, shape (nz,)."""

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """What it does under the command u, shape (n,).

        A law that takes no command's place gets the torques of the drives for u.
        """


class FrictionLaw(StatefulLaw, Protocol):
    """A law of friction with states.

    Attributes:
        absent: Why a scene has none, for display: "no bristles".
        summary: What of it a scene has, for display: "2 joints, as many states".
    """

    absent: str
    summary: str

    @classmethod
    def of(cls, model: ArmModel) -> Self | None:
        """The law of the joints that ask for it; None if none does.

        Raises:
            SceneError: If the coefficients of a joint do not go together.
        """

    def fastest_rate(self, M: Array, v: Array) -> float:
        """How fast it may answer in [1/s], whatever the initial state.

        Args:
            M: Mass matrix at the initial position, shape (n, n).
            v: Initial velocities in [rad/s] or [m/s], shape (n,).
        """

    def steady(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Its part of F when the states have settled; numbers (…, n) or expressions.

        Args:
            v: Joint velocities in [rad/s] or [m/s].
            direction: Which way joints slide, or are about to, -1 to 1.
            q: Joint positions in [rad] or [m].
            load: Torques of the drives in [N m] or [N].
        """


@dataclass(frozen=True)
class Ensemble:
    """All the laws of a scene as one; the states follow one another in the laws' order.

    Attributes:
        laws: The laws.
        n: Degrees of freedom.
    """

    laws: tuple[StatefulLaw, ...]
    n: int

    @property
    def names(self) -> tuple[str, ...]:
        """All states, for display."""
        return tuple(name for law in self.laws for name in law.names)

    @property
    def scale(self) -> Array:
        """Size that matters of each state, shape (nz,)."""
        return np.concatenate([np.zeros(0), *(law.scale for law in self.laws)])

    def initial(self, q: Array, v: Array) -> Array:
        """States when the arm is put to q, v, shape (nz,)."""
        return np.concatenate([np.zeros(0), *(law.initial(q, v) for law in self.laws)])

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """What the laws do together, and u where it acts directly, as torque and as power."""
        load = self.drive(q, v, z, u)
        flows = [
            law.equations(q, v, part, u if law.replaces_command.any() else load)
            for law, part in self._parts(z)
        ]
        direct = ca.sparsify(self._direct()) * u
        return Flow(
            sum((flow.torque for flow in flows), direct),
            ca.vertcat(ca.SX(0, 1), *(flow.slope for flow in flows)),
            total(flow.stored for flow in flows),
            ca.dot(direct, v) + total(flow.supplied for flow in flows),
            total(flow.lost for flow in flows),
        )

    def drive(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> ca.SX:
        """Torque that the drives put on the links: u, or what a law has in its place."""
        torque = self._direct() * u
        for law, part in self._parts(z):
            if law.replaces_command.any():
                chosen = ca.DM(law.replaces_command.astype(float))
                torque = torque + chosen * law.equations(q, v, part, u).torque
        return torque

    def _direct(self) -> ca.SX:
        """1 for joints on which the command acts as a torque, else 0."""
        replaced = np.zeros(self.n, dtype=bool)
        for law in self.laws:
            replaced |= law.replaces_command
        return ca.SX(ca.DM(np.logical_not(replaced).astype(float)))

    def _parts(self, z: ca.SX) -> list[tuple[StatefulLaw, ca.SX]]:
        ends = np.cumsum([0, *(len(law.names) for law in self.laws)])
        return [(law, z[a:b]) for law, a, b in zip(self.laws, ends, ends[1:], strict=False)]


def total(terms: Iterable[ca.SX | float]) -> ca.SX:
    """Their sum as an expression, zero without any."""
    return sum(terms, ca.SX(0.0))
