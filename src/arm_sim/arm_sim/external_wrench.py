# SPDX-License-Identifier: Apache-2.0
"""Wrenches on frames of an arm, as torques of its joints: τ = Jᵀ f."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import ArmModel, Dynamics
from arm_dynamics.arrays import Array, vector

if TYPE_CHECKING:
    from arm_dynamics.task_space.task_space import TaskSpace


@dataclass(frozen=True)
class _Push:
    """A wrench on a frame, and the last tick in which it acts."""

    task: TaskSpace
    wrench: Array
    until: int


class ExternalWrenches:
    """The newest wrench on each frame, while it acts.

    Virtual work: f·(J q̇) = (Jᵀ f)·q̇ for every q̇ (Craig, Introduction to Robotics, section 5.9).
    """

    def __init__(self, dynamics: Dynamics | ArmModel, reference: str = "local") -> None:
        """Start without wrenches.

        Args:
            dynamics: The arm, or its model.
            reference: Axes and point of the wrenches: ``local`` (the frame's), or
                ``local_world_aligned`` (at the frame's origin, axes of the world).

        Raises:
            InvalidInput: If the reference is unknown.
        """
        self._dynamics, self._reference = dynamics, reference
        self._pushes: dict[str, _Push] = {}

    @property
    def active(self) -> tuple[str, ...]:
        """Frames with a wrench."""
        return tuple(self._pushes)

    def push(self, frame: str, wrench: ArrayLike, until: int) -> None:
        """Apply a wrench to a frame.

        Args:
            frame: A frame that moves.
            wrench: Force in [N] and moment in [N m], shape (6,).
            until: Last tick in which it acts.

        Raises:
            InvalidInput: If the frame is unknown or fixed, or a number is not finite.
        """
        from arm_dynamics.task_space.task_space import TaskSpace  # most arms are never pushed

        task = TaskSpace(self._dynamics, frame, self._reference)
        self._pushes[frame] = _Push(task, vector("wrench", wrench, 6), until)

    def clear(self) -> None:
        """Remove all wrenches."""
        self._pushes.clear()

    def advance(self, q: Array, tick: int) -> Array:
        """Remove expired wrenches; joint torques of all that act in a tick, shape (n,).

        Args:
            q: Joint positions in [rad] or [m], shape (n,).
            tick: Number of the tick.
        """
        self._pushes = {f: push for f, push in self._pushes.items() if tick <= push.until}
        tau = np.zeros(self._dynamics.n)
        for push in self._pushes.values():
            tau += push.task.jacobian(q).T @ push.wrench
        return tau
