# SPDX-License-Identifier: Apache-2.0
"""The next effective command: the newest one, or the policy if that is stale."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_sim.imperfections import Line
from arm_sim.ros.node_library import library
from arm_sim.servo import JointCommand

BRAKE, SERVO, ZERO, HOLD, GRAVITY = "brake", "servo", "zero", "hold", "gravity"
POLICIES = (BRAKE, SERVO, ZERO, HOLD, GRAVITY)


def in_force(policy: str) -> str:
    """What holds the arm without commands, for messages."""
    return f"{'brakes engaged' if policy == BRAKE else 'fallback'} (stale_policy: {policy})"


class Stop(Enum):
    """The arm is stopped and then held."""

    BRAKES = BRAKE
    SERVO = SERVO


type Command = Sequence[float] | JointCommand
"""Efforts of n joints, or a command for each joint."""


class LatestCommand:
    """A slot that one thread fills and another one reads; only the newest command counts.

    Age is counted in ticks since a command was first used, so that a run by hand is reproducible;
    a tick of a loop that catches up counts only in part, see ``RealtimeLoop.share``.
    If the scene delays or loses commands, a command counts when it has arrived. Positions, and
    velocities of zero, never become stale: a robot holds its commanded position.

    Args:
        dynamics: The arm whose gravity the policy ``gravity`` compensates.
        line: Delays and losses of commands; None: they arrive immediately.

    Attributes:
        dynamics: The arm whose gravity the policy ``gravity`` compensates; may be replaced.
        age: Ticks since the newest command was first used; 0 without one.
        stale: Whether the policy acts because commands have stopped.
        stale_count: Number of times that commands have stopped.
        extended: Number of ticks for which a command acted beyond its time, see ``take``.
        timeout: Ticks for which a command may act; 0: forever.
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
        self.age = 0.0
        self.stale = False
        self.stale_count = self.extended = 0
        self.configure(0, ZERO)

    def configure(self, timeout: int, policy: str) -> None:
        """Set when a command is stale.

        Args:
            timeout: Ticks for which a command may act; 0: forever.
            policy: What acts after that and before the first command: ``brake`` and ``servo`` stop
                the arm and hold it, ``zero`` effort, ``hold`` of the last command, or ``gravity``,
                the effort that compensates gravity and springs.
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
        """If commands are delayed, make the one that arrived by this tick the newest."""
        if self._line is None:
            return
        if self._sent is not None:
            self._line.send(tick, self._sent)
            self._sent = None
        self._newest = self._line.receive(tick)

    def clear(self) -> None:
        """Discard all commands."""
        self._newest = self._used = self._sent = None
        self.age, self.stale, self._any = 0.0, False, False
        if self._line is not None:
            self._line.restart()

    @property
    def empty(self) -> bool:
        """Whether no command has arrived yet."""
        return not self._any

    def expires(self, share: float) -> bool:
        """Whether the command that acts is too old for a tick that ages it by ``share``."""
        return not self.stale and self._newest is self._used and self._is_old(share)

    def _is_old(self, share: float) -> bool:
        if self._used is None or self._lasting:
            return False
        return bool(library().is_stale(self.age, share, self.timeout))

    def take(self, q: Array, share: float = 1.0, extend: bool = False) -> Command | Stop:
        """Return the command of the next tick, and count that tick.

        Args:
            q: Current positions in [rad], shape (n,).
            share: Part of a tick by which the command ages.
            extend: Whether the command goes on acting, as a newer one may have arrived that cannot
                be read yet.
        """
        newest = self._newest
        if newest is None:
            return self._policy(q)
        if newest is not self._used:
            self._used, self.age, self.stale = newest, 0.0, False
            self._lasting = isinstance(newest, JointCommand) and newest.stays
        stale = self._is_old(share) and not extend
        self.age += share
        self.extended += extend
        if not stale:
            return newest
        self.stale_count += not self.stale
        self.stale = True
        return self._policy(q)

    @property
    def efforts(self) -> Sequence[float] | None:
        """Efforts that act until they are stale; None if something else acts."""
        newest = self._newest
        if newest is not self._used or self.stale or self._line is not None:
            return None
        return None if isinstance(newest, JointCommand) else newest

    def acted(self, before: Sequence[float], efforts: Sequence[float], age: float) -> None:
        """Register the efforts of ticks that were executed elsewhere.

        Args:
            before: Value of ``efforts`` before them; if it is no longer the newest command, one
                arrived that has not acted yet.
            efforts: Efforts that acted last.
            age: Ticks since they acted first.
        """
        if self._newest is before:
            self._newest = self._used = efforts
        self.age = age

    def held(self, q: Array) -> Command | Stop:
        """Return the command of a tick that does not age it."""
        newest = self._newest
        return self._policy(q) if newest is None else newest
