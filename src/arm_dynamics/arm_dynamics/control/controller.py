# SPDX-License-Identifier: Apache-2.0
"""What a controller is: an object with one method, ``torque(state, reference) -> τ``."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from arm_dynamics.arrays import Array, all_finite, vector
from arm_dynamics.attributes import sealed
from arm_dynamics.exceptions import InvalidInput

_FLOAT = np.dtype(float)
_NONE = object()  # without a reference


class ArmState(Protocol):
    """Anything with joint positions ``q`` and velocities ``v``, such as ``Measured``."""

    @property
    def q(self) -> Array:
        """Joint positions."""

    @property
    def v(self) -> Array:
        """Joint velocities."""


@sealed
@dataclass(frozen=True, slots=True)
class Measured:
    """Joint positions and velocities as measured.

    Attributes:
        q: Positions in [rad] or [m], shape (n,).
        v: Velocities in [rad/s] or [m/s], shape (n,).
    """

    q: Array
    v: Array


class CheckedState(Measured):
    """A state whose shapes and finiteness its maker has checked: the ROS node, or ``custom``."""

    __slots__ = ()


class Controller[Goal](Protocol):
    """Computes the torque that moves an arm to its reference, of joints or of a frame.

    A class of your own must have this one method. It may derive from this protocol, but need not;
    its method ``restart()``, if any, is called when time jumps, or when it takes over from
    another controller. Its constructor names the arguments that it needs (``dynamics``, ``dt``,
    …), see ``make_controller``.
    """

    def torque(self, state: ArmState, reference: Goal) -> Array:
        """Return joint torques in [N m] or [N], finite, shape (n,), constant until the next call.

        Args:
            state: Joint positions ``q`` and velocities ``v``, each of shape (n,), read-only.
            reference: Desired joint motion: ``q``, ``v`` and ``a``, each of shape (n,), of a
                ``trajectory.Reference``. Its ``tau`` is added by ``make_controller``.
        """


AnyController = Controller[Any]
"""A controller for any kind of reference."""


@runtime_checkable
class Restartable(Protocol):
    """A controller with memory."""

    def restart(self) -> None:
        """Reset the memory."""


def restart(control: object) -> None:
    """Reset the memory of a controller, if it has one."""
    if isinstance(control, Restartable):
        control.restart()


def checked(state: ArmState, n: int, reference: object = _NONE) -> tuple[Array, Array]:
    """Positions and velocities of a state, each of shape (n,) and finite.

    A ``CheckedState`` with a valid reference is not checked again. The shapes of the reference
    are checked as well, if there is one.
    """
    q, v = state.q, state.v
    if type(state) is CheckedState:
        return q, v
    if reference is not _NONE:
        _check_reference(reference, n)
    arrays = isinstance(q, np.ndarray) and isinstance(v, np.ndarray)
    if arrays and q.shape == v.shape == (n,) and q.dtype == v.dtype == _FLOAT:
        if all_finite(q) and all_finite(v):
            return q, v
    for name, value in (("state.q", q), ("state.v", v)):
        vector(name, value, n)
    return np.asarray(q, float), np.asarray(v, float)


def _check_reference(reference: object, n: int) -> None:
    """Check that a reference has positions, velocities and accelerations of shape (n,)."""
    for name in ("q", "v", "a"):
        value = getattr(reference, name, None)
        if value is None:
            raise InvalidInput(
                f"the reference is of type {type(reference).__name__}; positions q, velocities v "
                "and accelerations a are expected, as Reference(q, v, a) has them"
            )
        if np.shape(value) != (n,):
            raise InvalidInput(f"reference.{name} has shape {np.shape(value)}; ({n},) is expected")


def added_torques(reference: object, n: int) -> Array | None:
    """Torques of a reference to add to a controller's, shape (n,); None for none."""
    tau = getattr(reference, "tau", None)
    return None if tau is None else vector("reference.tau", tau, n)
