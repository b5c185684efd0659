# SPDX-License-Identifier: Apache-2.0
"""The reference defined by a stream of commands, tick by tick."""

from __future__ import annotations

import numpy as np

from arm_sim.servo.command import JointCommand

# Commands further apart than this, in [s], are separate set-points; closer ones form a stream,
# whose differences define the velocity.
STREAM = 0.1
# Number of periods for which a stream is extrapolated without new commands.
LATE = 2


class Setpoints:
    """A reference from successive positions, with the velocity of their stream.

    A servo with a position command alone lags behind by 2 ζ v/ω. Positions without a velocity
    therefore get that of their stream: the difference of successive positions over the time
    between them, by their stamps if they have any, else in ticks. Between two commands the
    reference is extrapolated, for at most ``LATE`` periods; then it stops at the last position.

    Args:
        n: Number of joints.
        dt: Length of a tick in [s].

    Attributes:
        rows: Joints that track a velocity, joints that track a position (1 or 0), positions,
            velocities and efforts of the reference, shape (5 n,): the input of ``servo_law``.
        at_rest: Whether the reference is at rest.
    """

    def __init__(self, n: int, dt: float) -> None:
        self._dt, self.rows = dt, np.zeros(5 * n)
        self._moves, self._leads, self._q, self._v, self._added = self.rows.reshape(5, n)
        self._moving = np.zeros(n)
        self.restart()

    @property
    def all_follow(self) -> bool:
        """Whether every joint tracks a position or a velocity."""
        return bool((self._moves > 0.0).all())

    def restart(self) -> None:
        """Discard earlier commands."""
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
        """Time between this command and the previous one in [s]; 0 if they are not a stream."""
        last = self._last
        if last is None:
            return 0.0
        stamped = command.stamp and last.stamp
        sent = 1e-9 * (command.stamp - last.stamp) if stamped else (step - self._since) * self._dt
        return sent if 0.0 < sent <= STREAM else 0.0

    def _go_on(self, step: int) -> None:
        """Extrapolate between two commands, or after the last."""
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
