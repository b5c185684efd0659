# SPDX-License-Identifier: Apache-2.0
"""The reference that a stream of commands means, tick by tick."""

from __future__ import annotations

import numpy as np

from arm_sim.servo.command import JointCommand

# Commands further apart than this, in [s], are set-points of their own; nearer ones are a stream,
# whose differences are the velocity.
STREAM = 0.1
# For how many of its periods a stream goes on when nothing comes.
LATE = 2


class Setpoints:
    """Positions that come one after another, and the velocity with which they move.

    A servo that is told only where to be lags behind by 2 ζ v/ω. So positions that come without a
    velocity get that of their stream: the difference from one to the next over the time between
    them, by their stamps where they have some, else in ticks. Between two commands the reference
    moves on, for ``LATE`` periods at most; then it stands at the last position.

    Args:
        n: Number of joints.
        dt: Length of a tick in [s].

    Attributes:
        rows: Which joints follow a velocity, which a position (1 or 0), positions, velocities and
            efforts of the reference, shape (5 n,): what ``servo_law`` takes.
        at_rest: Whether the reference stands still.
    """

    def __init__(self, n: int, dt: float) -> None:
        self._dt, self.rows = dt, np.zeros(5 * n)
        self._moves, self._leads, self._q, self._v, self._added = self.rows.reshape(5, n)
        self._moving = np.zeros(n)
        self.restart()

    def restart(self) -> None:
        """Forget the commands before."""
        self._last: JointCommand | None = None
        self._since, self._until, self.at_rest = 0, 0, False

    def at(self, command: JointCommand, step: int) -> None:
        """Set ``rows`` for the tick that begins after ``step`` ticks, under a command."""
        if command is not self._last:
            self._take(command, step)
        elif step > self._since and not self.at_rest:
            self._go_on(step)

    def _take(self, command: JointCommand, step: int) -> None:
        q, v, effort = command.position, command.velocity, command.effort
        leads, drives = q == q, v == v  # NaN differs from itself
        period, last = self._period(command, step), self._last
        moving = np.zeros(len(q))
        if last is not None and period:
            moving = (q - last.position) / period
            moving[moving != moving] = 0.0
        moving[drives] = v[drives]
        self._leads[:], self._moves[:] = leads, leads | drives
        self._q[:] = np.where(leads, q, 0.0)
        self._v[:], self._moving = moving, np.where(leads, moving, 0.0)
        self._added[:] = np.where(effort == effort, effort, 0.0)
        self._last, self._since = command, step
        self._until = step + round(LATE * period / self._dt)
        self.at_rest = not moving.any()

    def _period(self, command: JointCommand, step: int) -> float:
        """Time between this command and the one before in [s]; 0 if they are no stream."""
        last = self._last
        if last is None:
            return 0.0
        stamped = command.stamp and last.stamp
        sent = 1e-9 * (command.stamp - last.stamp) if stamped else (step - self._since) * self._dt
        return sent if 0.0 < sent <= STREAM else 0.0

    def _go_on(self, step: int) -> None:
        """Between two commands, or after the last."""
        last, moving = self._last, self._moving
        if last is None or not moving.any():
            return
        leads = self._leads > 0.0
        if step <= self._until:
            passed = (step - self._since) * self._dt
            self._q[leads] = last.position[leads] + passed * moving[leads]
            return
        self._q[leads], self._v[leads] = last.position[leads], 0.0
        self._moving = np.zeros(len(moving))
        self.at_rest = not self._v.any()
