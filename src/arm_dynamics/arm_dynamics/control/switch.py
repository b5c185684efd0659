# SPDX-License-Identifier: Apache-2.0
"""Transition from one controller to another."""

from typing import Any

import numpy as np

from arm_dynamics.arrays import Array, positive
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import AnyController, ArmState, Restartable, restart
from arm_dynamics.exceptions import InvalidInput


@sealed
class Switch:
    """Switches from one controller to another without a jump of the torque.

    The first torque of the new one is the last of the old one; the difference fades out smoothly.
    References may be of another kind after the switch.

    Example:
        >>> control = Switch(PDGravity(dyn, kp, kd), dt=1e-3)
        >>> tau = control.torque(state, reference)
        >>> control.to(ComputedTorque(dyn))
    """

    def __init__(self, control: AnyController, dt: float, fade: float = 0.2) -> None:
        """Start with a controller.

        Args:
            control: The first one.
            dt: Time between calls in [s].
            fade: Duration of a transition in [s], zero for one tick.

        Raises:
            InvalidInput: If a time is out of range.
        """
        if not 0.0 <= fade < np.inf:
            raise InvalidInput(f"fade is {fade}; a time of at least zero is expected")
        self._active, self._ticks = control, max(1, round(fade / positive("dt", dt)))
        self._last: Array | None = None
        self._offset: Array | None = None
        self._left = 0

    @property
    def active(self) -> AnyController:
        """The active controller."""
        return self._active

    @property
    def fading(self) -> bool:
        """Whether a transition is in progress."""
        return self._left > 0

    def to(self, control: AnyController) -> None:
        """Switch to ``control`` at the next tick; its memory is reset."""
        restart(control)
        self._active, self._offset, self._left = control, None, self._ticks

    def retune(self, control: AnyController) -> None:
        """Use the same controller with other gains: immediately, unless it has memory."""
        if isinstance(control, Restartable):
            self.to(control)
        else:
            self._active = control

    def note(self, tau: Array) -> None:
        """Set the last torque in [N m] or [N], shape (n,), if it was computed elsewhere."""
        self._last = tau

    def restart(self) -> None:
        """Reset a transition in progress, and the memory of the controller."""
        self._last, self._offset, self._left = None, None, 0
        restart(self._active)

    def torque(self, state: ArmState, reference: Any) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        tau = self._active.torque(state, reference)
        if self._last is None:
            self._left = 0  # there is nothing to fade from
        elif self._left:
            if self._offset is None:
                self._offset, tau = self._last - tau, self._last
            else:
                s = self._left / self._ticks
                tau = tau + self._offset * (s * s * (3.0 - 2.0 * s))
            self._left -= 1
        self._last = tau
        return tau.copy()
