# SPDX-License-Identifier: Apache-2.0
"""The reference defined by a stream of commands, tick by tick."""

import numpy as np

from arm_sim.servo.command import JointCommand

# Commands further apart than this, in [s], are separate set-points; closer ones form a stream,
# whose differences define the velocity.
MAX_STREAM_PERIOD = 0.1
# Number of periods for which a stream is extrapolated without new commands
EXTRAPOLATED_PERIODS = 2


class Setpoints:
    """A reference from successive positions, with the velocity of their stream.

    A servo with a position command alone lags behind by 2 ζ v/ω. Positions without a velocity
    therefore get that of their stream: the difference of successive positions over the time
    between them, by their stamps if they have any, else in ticks. Between two commands the
    reference is extrapolated, for at most ``EXTRAPOLATED_PERIODS``; then it stops at the last
    position.

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
        self._tracks_velocity, self._tracks_position, *reference = self.rows.reshape(5, n)
        self._q, self._v, self._effort = reference
        self._stream_velocity = np.zeros(n)
        self._last: JointCommand | None = None
        self._since, self._until, self.at_rest = 0, 0, False

    @property
    def all_tracked(self) -> bool:
        """Whether every joint tracks a position or a velocity."""
        return bool((self._tracks_velocity > 0.0).all())

    def restart(self) -> None:
        """Discard earlier commands."""
        self._last, self._since, self._until, self.at_rest = None, 0, 0, False

    def advance(self, command: JointCommand, step: int) -> None:
        """Set ``rows`` for the tick that begins after ``step`` ticks, under a command."""
        if command is not self._last:
            self._begin(command, step)
        elif step > self._since and not self.at_rest:
            self._extrapolate(step)

    def _begin(self, command: JointCommand, step: int) -> None:
        """Follow a command from a tick on; its velocity is given, or that since the last one."""
        q, v, effort = command.position, command.velocity, command.effort
        has_position, has_velocity = ~np.isnan(q), ~np.isnan(v)
        period, last = self._period(command, step), self._last
        velocity = np.zeros(len(q))
        if last is not None and period:
            velocity = (q - last.position) / period
            velocity[np.isnan(velocity)] = 0.0
        velocity[has_velocity] = v[has_velocity]
        self._tracks_position[:] = has_position
        self._tracks_velocity[:] = has_position | has_velocity
        self._q[:], self._v[:] = np.where(has_position, q, 0.0), velocity
        self._stream_velocity = np.where(has_position, velocity, 0.0)
        self._effort[:] = np.where(np.isnan(effort), 0.0, effort)
        self._last, self._since = command, step
        self._until = step + round(EXTRAPOLATED_PERIODS * period / self._dt)
        self.at_rest = not velocity.any()

    def _period(self, command: JointCommand, step: int) -> float:
        """Time between this command and the previous one in [s]; 0 if they are not a stream."""
        last = self._last
        if last is None:
            return 0.0
        stamped = command.stamp and last.stamp
        ticks = step - self._since
        period = 1e-9 * (command.stamp - last.stamp) if stamped else ticks * self._dt
        return period if 0.0 < period <= MAX_STREAM_PERIOD else 0.0

    def _extrapolate(self, step: int) -> None:
        """Extrapolate between two commands, or after the last."""
        last, velocity = self._last, self._stream_velocity
        if last is None or not velocity.any():
            return
        tracked = self._tracks_position > 0.0
        if step <= self._until:
            elapsed = (step - self._since) * self._dt
            self._q[tracked] = last.position[tracked] + elapsed * velocity[tracked]
            return
        self._q[tracked], self._v[tracked] = last.position[tracked], 0.0
        self._stream_velocity = np.zeros(len(velocity))
        self.at_rest = not self._v.any()
