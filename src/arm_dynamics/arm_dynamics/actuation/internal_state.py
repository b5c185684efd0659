# SPDX-License-Identifier: Apache-2.0
"""Models with internal states between the command u and the torque at the joints.

The rigid arm has the states q and v. A motor adds a current, a belt the angle of its motor, a
bristle its deflection: such a model defines additional states z, their derivatives, and the energy
that it stores, receives and dissipates. The simulator integrates x = (q, v, z).
"""

from collections.abc import Iterable
from enum import Enum, auto
from typing import Protocol, Self

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.model.arm import ArmModel


@frozen
class Flow:
    """Torques, state derivatives and energy flow of a model at an instant.

    Attributes:
        torque: Torque that it adds on the link side of each joint in [N m] or [N], shape (n,).
        slope: Derivative of its states, shape (nz,).
        stored: Energy that it stores in [J]: elastic, magnetic, of rotors not included in M; a
            function of q, v and its states.
        supplied: Power received from outside in [W], such as voltage times current.
        lost: Dissipated power in [W].
    """

    torque: ca.SX
    slope: ca.SX
    stored: ca.SX | float = 0.0
    supplied: ca.SX | float = 0.0
    lost: ca.SX | float = 0.0


class StateKind(Enum):
    """Physical quantities of internal states; names are for display only."""

    CURRENT = auto()
    MOTOR_POSITION = auto()
    MOTOR_VELOCITY = auto()
    DEFLECTION = auto()
    """State of a bristle, which keeps its value at rest."""
    HYSTERESIS = auto()
    """State of a transmission, which keeps its value at rest."""


@frozen
class InternalState:
    """One internal state of a model.

    Attributes:
        joint: Index of its joint.
        kind: Physical quantity of the state.
        name: Name for display, with joint and unit: "joint1 motor current [A]".
        scale: Scale for error control: the tolerance times this scale is the admissible error, as
            for a radian.
    """

    joint: int
    kind: StateKind
    name: str
    scale: float


class StatefulLaw(Protocol):
    """A model with internal states (possibly none), or one that replaces the command.

    Attributes:
        title: Name of the model, for display: "LuGre friction".
        states: States of the model, nz of them.
        replaces_command: Joints for which its torque replaces u, shape (n,); for the others u acts
            directly.
    """

    title: str
    states: tuple[InternalState, ...]
    replaces_command: NDArray[np.bool_]

    def initial(self, q: Array, v: Array) -> Array:
        """Initial states of the model at q, v, shape (nz,)."""

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """Torques of the model, state derivatives and energy flow under the command u, shape (n,).

        A model that replaces no command receives the torques of the drives as u.
        """


class FrictionLaw(StatefulLaw, Protocol):
    """A friction model with internal states.

    Attributes:
        absent: Display text for a scene without it: "no bristles".
        summary: Display text for a scene with it: "2 joints, as many states".
    """

    absent: str
    summary: str

    @classmethod
    def of(cls, model: ArmModel) -> Self | None:
        """The model for the joints that use it; None if none does.

        Raises:
            SceneError: If the coefficients of a joint contradict one another.
        """

    def fastest_rate(self, M: Array, v: Array) -> float:
        """Upper estimate of the model's fastest rate in [1/s], whatever the initial state.

        Args:
            M: Mass matrix at the initial position, shape (n, n).
            v: Initial velocities in [rad/s] or [m/s], shape (n,).
        """

    def steady(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Contribution of the model to F in steady state; numbers (…, n) or expressions.

        Args:
            v: Joint velocities in [rad/s] or [m/s].
            direction: Direction in which joints slide, or are about to, -1 to 1.
            q: Joint positions in [rad] or [m].
            load: Torques of the drives in [N m] or [N].
        """


@frozen
class Ensemble:
    """All models of a scene as one, maybe none; their states are concatenated in order.

    Attributes:
        laws: The models.
        n: Degrees of freedom.
    """

    laws: tuple[StatefulLaw, ...]
    n: int

    def __bool__(self) -> bool:
        """Whether there are any models."""
        return bool(self.laws)

    @property
    def states(self) -> tuple[InternalState, ...]:
        """All states of the models."""
        return tuple(state for law in self.laws for state in law.states)

    @property
    def names(self) -> tuple[str, ...]:
        """All states, for display."""
        return tuple(state.name for state in self.states)

    def places(self, kind: StateKind) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices in x of the states of a kind, and of the joints to which they belong."""
        pairs = [(k, s.joint) for k, s in enumerate(self.states, 2 * self.n) if s.kind is kind]
        places, joints = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        return places, joints

    @property
    def scale(self) -> Array:
        """Scale of q, v and each state for error control, shape (2n + nz,)."""
        return np.array([*np.ones(2 * self.n), *(state.scale for state in self.states)])

    def initial(self, q: Array, v: Array) -> Array:
        """Initial states at q, v, shape (nz,)."""
        return np.concatenate([np.zeros(0), *(law.initial(q, v) for law in self.laws)])

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """The models' total torque and power, including u where it acts directly."""
        load = self.drive(q, v, z, u)
        flows = [
            law.equations(q, v, part, u if law.replaces_command.any() else load)
            for law, part in self.parts(z)
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
        """Torque of the drives on the links: u, or that of the model that replaces it."""
        torque = self._direct() * u
        for law, part in self.parts(z):
            if law.replaces_command.any():
                is_replaced = ca.DM(law.replaces_command.astype(float))
                torque = torque + is_replaced * law.equations(q, v, part, u).torque
        return torque

    def _direct(self) -> ca.SX:
        """1 for joints on which the command acts as a torque, else 0."""
        unreplaced = [np.ones(self.n), *(~law.replaces_command for law in self.laws)]
        return ca.SX(ca.DM(np.all(unreplaced, axis=0).astype(float)))

    def parts(self, z: ca.SX) -> list[tuple[StatefulLaw, ca.SX]]:
        """Each law with its states among z."""
        ends = np.cumsum([0, *(len(law.states) for law in self.laws)])
        return [(law, z[a:b]) for law, a, b in zip(self.laws, ends, ends[1:], strict=False)]


def total(terms: Iterable[ca.SX | float]) -> ca.SX:
    """Sum of the terms as an expression; zero if there are none."""
    return sum(terms, ca.SX(0.0))
