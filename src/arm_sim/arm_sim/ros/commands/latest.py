# SPDX-License-Identifier: Apache-2.0
"""What acts next: the newest command, or the policy when that one is too old."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_sim.imperfections import Line
from arm_sim.servo import JointCommand

BRAKE, SERVO, ZERO, HOLD, GRAVITY = "brake", "servo", "zero", "hold", "gravity"
POLICIES = (BRAKE, SERVO, ZERO, HOLD, GRAVITY)


class Stop(Enum):
    """The arm is stopped, and then held where it is."""

    BRAKES = BRAKE
    SERVO = SERVO


type Command = Sequence[float] | JointCommand
"""Efforts of n joints, or what each joint is commanded."""


class LatestCommand:
    """A slot that one thread fills and another one reads; only the newest command counts.

    Age is counted in ticks since a command was first used, so a run by hand is repeatable. Where
    the scene's commands take time, or get lost, one is newest when it has arrived. Positions, and
    velocities of zero, do not grow old: a robot holds where it was told to be.

    Args:
        dynamics: The arm whose weight the policy ``gravity`` carries.
        line: What commands come on; None: they arrive at once.

    Attributes:
        dynamics: The arm whose weight the policy ``gravity`` carries; may be replaced.
        age: Ticks since the newest command was first used; 0 without one.
        stale: Whether the policy is in force because commands have stopped.
        stale_count: How often commands have stopped.
        timeout: Ticks that a command may act; 0: for ever.
    """

    def __init__(self, dynamics: Dynamics, line: Line[Sequence[float]] | None = None) -> None:
        self.dynamics, zero = dynamics, np.zeros(dynamics.n)
        none: Sequence[float] = zero.tolist()

        def standing(q: Array) -> Sequence[float]:
            held = self.dynamics.gravity(q) + self.dynamics.spring(q)
            return list(self.dynamics.command_map(q, zero, held).tolist())

        self._policies: dict[str, Callable[[Array], Command | Stop]] = {
            BRAKE: lambda q: Stop.BRAKES,
            SERVO: lambda q: Stop.SERVO,
            ZERO: lambda q: none,
            HOLD: lambda q: none if self._used is None else self._used,
            GRAVITY: standing,
        }
        self._newest: Command | None = None
        self._sent: Command | None = None
        self._line, self._any = line, False
        self._used: Command | None = None
        self._lasting = False
        self.age = 0
        self.stale = False
        self.stale_count = 0
        self.configure(0, ZERO)

    def configure(self, timeout: int, policy: str) -> None:
        """Choose when a command is old.

        Args:
            timeout: Ticks that a command may act; 0: for ever.
            policy: What acts after that and before the first command: ``brake`` and ``servo`` stop
                the arm and hold it, ``zero`` effort, ``hold`` of the last command, or the effort
                that carries what springs leave of the arm's weight, ``gravity``.
        """
        self.timeout, self._policy = timeout, self._policies[policy]

    def put(self, command: Command) -> None:
        """Make ``command`` the newest one; it must not be changed afterwards."""
        self._any = True
        if self._line is None:
            self._newest = command
        else:
            self._sent = command

    def arrive(self, tick: int) -> None:
        """Where commands take time, make what has arrived by this tick the newest one."""
        if self._line is None:
            return
        if self._sent is not None:
            self._line.send(tick, self._sent)
            self._sent = None
        self._newest = self._line.receive(tick)

    def clear(self) -> None:
        """Forget all commands."""
        self._newest = self._used = self._sent = None
        self.age, self.stale, self._any = 0, False, False
        if self._line is not None:
            self._line.restart()

    @property
    def empty(self) -> bool:
        """Whether no command has come yet."""
        return not self._any

    def take(self, q: Array) -> Command | Stop:
        """Return what acts in the next tick, and count that tick.

        Args:
            q: Present positions in [rad], shape (n,).
        """
        newest = self._newest
        if newest is None:
            return self._policy(q)
        if newest is not self._used:
            self._used, self.age, self.stale = newest, 0, False
            self._lasting = isinstance(newest, JointCommand) and newest.stays
        self.age += 1
        if self._lasting or not self.timeout or self.age <= self.timeout:
            return newest
        self.stale_count += not self.stale
        self.stale = True
        return self._policy(q)

    @property
    def efforts(self) -> Sequence[float] | None:
        """Efforts that act, and go on acting until they are too old; None: something else acts."""
        newest = self._newest
        if newest is not self._used or self.stale or self._line is not None:
            return None
        return None if isinstance(newest, JointCommand) else newest

    def acted(self, before: Sequence[float], efforts: Sequence[float], age: int) -> None:
        """Note what acted in ticks that were made elsewhere.

        Args:
            before: What ``efforts`` was before them; where it is not the newest command any more,
                one came that has not acted yet.
            efforts: What acted last.
            age: Ticks since it acted first.
        """
        if self._newest is before:
            self._newest = self._used = efforts
        self.age = age

    def held(self, q: Array) -> Command | Stop:
        """Return what acts in a tick that does not make the newest command older."""
        newest = self._newest
        return self._policy(q) if newest is None else newest
