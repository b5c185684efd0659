# SPDX-License-Identifier: Apache-2.0
"""Controllers as formulas, each written once, for numbers and expressions alike."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, cast, runtime_checkable

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import ArmState, checked, restart
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.robot import Robot
from arm_dynamics.trajectory.reference import Reference

# Numbers of a formula, arrays or expressions
Parts = Sequence[Any]


class LawInput(NamedTuple):
    """Input of a formula: numbers or expressions.

    Attributes:
        rigid: ``RigidTerms`` or ``RigidExpressions`` of the arm.
        q: Joint positions.
        v: Joint velocities.
        desired: The reference.
    """

    rigid: Any
    q: Any
    v: Any
    desired: Reference


@runtime_checkable
class Law(Protocol):
    """A controller for joint references whose formula takes expressions, too.

    Attributes:
        key: What its formula depends on besides the model; None if it has no formula.
        tuning: Numbers of the formula that may change without compiling it again.
        memory: Numbers that it remembers from one call to the next.
    """

    @property
    def key(self) -> tuple[Any, ...] | None:
        """What the formula depends on."""

    @property
    def tuning(self) -> tuple[Array, ...]:
        """Numbers of the formula."""

    memory: tuple[Array, ...]

    def torque(self, state: ArmState, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,); see ``Controller.torque``."""

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """Torques, and the memory for the next call.

        Args:
            rigid: ``RigidExpressions`` of the arm.
            q: Joint positions.
            v: Joint velocities.
            desired: The reference.
            tuning: The attribute, arrays or expressions.
            memory: The attribute, likewise.

        Returns:
            Expressions. Torques may not be numbers in states that only ``torque`` can treat.
        """


@sealed
class JointLaw:
    """A controller of joints whose formula takes numbers and expressions alike.

    Attributes:
        tuning: Numbers of the formula, arrays of shape (n,).
        memory: Numbers that it remembers from one call to the next, likewise.
    """

    tuning: tuple[Array, ...]
    memory: tuple[Array, ...] = ()

    def __init__(self, n: int, robot: Robot | None = None) -> None:
        """Take the degrees of freedom, and the robot if its terms are in the formula."""
        self._n, self._rigid = n, None if robot is None else RigidTerms(robot)

    @property
    def key(self) -> tuple[Any, ...] | None:
        """What the formula depends on besides the model; see ``Law``."""
        return (type(self),)

    def torque(self, state: ArmState, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n, reference)
        tau, memory = self.formula(self._rigid, q, v, reference, self.tuning, self.memory)
        self.memory = tuple(memory)
        return np.asarray(tau)

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """Torques and the next memory, for numbers and expressions; see ``Law``."""
        raise NotImplementedError


class Wrapper:
    """A wrapper of a controller, which changes its torques by a formula.

    It is a ``Law`` if the controller is one; its tuning and memory then are the wrapper's own,
    followed by the controller's.

    Attributes:
        control: The controller.
    """

    _tuning: tuple[Array, ...] = ()
    _memory: tuple[Array, ...] = ()

    def __init__(self, control: Any, n: int, robot: Robot | None = None) -> None:
        """Take the controller of n joints, and the robot if its terms are in the formula."""
        self.control, self._law, self._n = control, cast(Any, law_of(control)), n
        self._rigid = None if robot is None else RigidTerms(robot)
        self.name = name_of(control)

    def adapt(self, tau: Any, inputs: LawInput, tuning: Parts, memory: Parts) -> tuple[Any, Parts]:
        """Torques in place of the controller's, and the wrapper's memory for the next call.

        For numbers and expressions; ``tuning`` and ``memory`` are the wrapper's own.
        """
        raise NotImplementedError

    def restart(self) -> None:
        """Let the controller forget the past."""
        restart(self.control)

    def torque(self, state: ArmState, reference: Any) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        q, v = checked(state, self._n)
        tau = self.control.torque(state, reference)
        inputs = LawInput(self._rigid, q, v, reference)
        tau, memory = self.adapt(tau, inputs, self._tuning, self._memory)
        self._memory = tuple(memory)
        return np.array(tau)

    @property
    def key(self) -> tuple[Any, ...] | None:
        """What the formula depends on besides the model; see ``Law``."""
        return None if self._law is None else (type(self), self._law.key)

    @property
    def tuning(self) -> tuple[Array, ...]:
        """Numbers of the formula."""
        return (*self._tuning, *(() if self._law is None else self._law.tuning))

    @property
    def memory(self) -> tuple[Array, ...]:
        """Numbers that it remembers from one call to the next."""
        return (*self._memory, *(() if self._law is None else self._law.memory))

    @memory.setter
    def memory(self, parts: tuple[Array, ...]) -> None:
        own = len(self._memory)
        self._memory = parts[:own]
        if self._law is not None:
            self._law.memory = parts[own:]

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """The controller's formula, changed; see ``Law``."""
        i, k = len(self._tuning), len(self._memory)
        tau, after = self._law.formula(rigid, q, v, desired, tuning[i:], memory[k:])
        tau, own = self.adapt(tau, LawInput(rigid, q, v, desired), tuning[:i], memory[:k])
        return tau, (*own, *after)


def law_of(control: object) -> Law | None:
    """The controller itself if it has a formula, else None."""
    return control if isinstance(control, Law) and control.key is not None else None


def name_of(law: object) -> str:
    """The class of a law, or the name of a user's."""
    return str(getattr(law, "name", type(law).__name__))
