# SPDX-License-Identifier: Apache-2.0
"""The next effective command: the newest one, or the policy if that is stale."""

from collections.abc import Sequence
from ctypes import Structure

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_sim.imperfections import Line
from arm_sim.ros.node_library import TICKS
from arm_sim.servo import JointCommand

BRAKE, SERVO, ZERO, HOLD, GRAVITY = "brake", "servo", "zero", "hold", "gravity"
POLICIES = (BRAKE, SERVO, ZERO, HOLD, GRAVITY)
_POLICY_OF = {TICKS.constants[policy.upper()]: policy for policy in POLICIES}
EFFORTS, JOINTS = TICKS.constants["EFFORTS"], TICKS.constants["JOINTS"]

# Efforts of n joints, or a command for each joint
type Command = Sequence[float] | JointCommand


def in_force(policy: str) -> str:
    """What holds the arm without commands, for messages."""
    return f"{'brakes engaged' if policy == BRAKE else 'fallback'} (stale_policy: {policy})"


class LatestCommand(Structure):
    """The newest command, and the policy that acts without one or when it is stale.

    Age is counted in ticks since a command was first used, so that a run by hand is reproducible;
    a tick of a loop that catches up counts only in part, see ``RealtimeLoop``.
    If the scene delays or loses commands, a command counts when it has arrived. Positions, and
    velocities of zero, never become stale: a robot holds its commanded position.
    It is ``slot_t`` of ticks.h, where other fields and the rules are; C reads most commands.

    Attributes:
        dynamics: The arm whose gravity the policy ``gravity`` compensates; may be replaced.
        line: Delays and losses of commands; None: they arrive immediately.
        age: Ticks since the newest command was first used; 0 without one.
        stale_count: Number of times that commands have stopped.
        extended: Number of ticks for which a command acted beyond its time.
        timeout: Ticks for which a command may act; 0: forever.
        joints: The newest command, if it is one of positions or velocities.
    """

    _fields_ = TICKS.fields("slot_t")

    def __init__(self, dynamics: Dynamics, line: Line[tuple[Command]] | None = None) -> None:
        self._efforts = np.zeros(dynamics.n)
        super().__init__(efforts=self._efforts.ctypes.data)
        self.dynamics, self.line = dynamics, line
        self.joints: JointCommand | None = None
        self._sent: Command | None = None
        self._last_delivery: tuple[Command] | None = None
        self.configure(0, ZERO)

    def configure(self, timeout: int, policy: str) -> None:
        """Set the ticks for which a command may act, 0: forever, and what acts without one.

        ``brake`` and ``servo`` stop the arm and hold it; ``zero`` is no effort; ``hold`` goes on
        with the last command; ``gravity`` is the effort that compensates gravity and springs.
        """
        self.timeout, self.policy = timeout, TICKS.constants[policy.upper()]

    def put(self, command: Command) -> None:
        """Make ``command`` the newest one; it must not be changed afterwards."""
        self.was_sent = True
        if self.line is None:
            self._make_newest(command)
        else:
            self._sent = command

    def deliver(self, tick: int) -> None:
        """If commands are delayed, make the one that arrived by this tick the newest."""
        if self.line is None:
            return
        if self._sent is not None:
            self.line.send(tick, (self._sent,))  # a new object, also for an equal command
            self._sent = None
        message = self.line.receive(tick)
        if message is not None and message is not self._last_delivery:
            self._last_delivery = message
            self._make_newest(*message)

    def _make_newest(self, command: Command) -> None:
        self.fresh, self.unread = True, False
        if isinstance(command, JointCommand):
            self.kind, self.joints, self.lasting = JOINTS, command, command.stays
        else:
            self.kind, self._efforts[:], self.lasting = EFFORTS, command, False

    def reset_counters(self) -> None:
        """Reset the counters."""
        self.stale_count = self.extended = 0

    def clear(self) -> None:
        """Discard all commands."""
        self.kind = self.fresh = self.stale = self.was_sent = self.unread = 0
        self.age, self._sent, self._last_delivery = 0.0, None, None
        if self.line is not None:
            self.line.restart()

    def take_efforts(self) -> tuple[float, ...] | None:
        """Efforts that C has accepted since the last call; None if there are none."""
        if not self.unread:
            return None
        self.unread = False
        return tuple(self._efforts.tolist())

    def command(self, actor: int, q: Array) -> str | Command:
        """The command of an actor of ticks.h at q, or the policy that stops the arm."""
        if actor == JOINTS:
            assert self.joints is not None
            return self.joints
        if actor == EFFORTS:
            return self._efforts
        policy = _POLICY_OF[actor]
        if policy == GRAVITY:
            return self.gravity(q)
        return np.zeros(len(q)) if policy == ZERO else policy

    def gravity(self, q: Array) -> Array:
        """Efforts that compensate gravity and springs at q, shape (n,) both."""
        tau = self.dynamics.gravity(q) + self.dynamics.spring(q)
        return self.dynamics.command_map(q, np.zeros(len(q)), tau)
