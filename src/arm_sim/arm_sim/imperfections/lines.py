# SPDX-License-Identifier: Apache-2.0
"""Transmission of messages from tick to tick, with delay, jitter and loss."""

from collections import deque
from math import ceil

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.scene import Scene
from arm_dynamics.scene import imperfections as schema
from arm_sim.imperfections.chance import Chance, Channel, uniform

# Fraction of a tick: a delay of whole ticks must not become one more by rounding.
_ROUNDING = 1e-6


class Line[T]:
    """Delivers the newest message that has arrived; overtaken messages are dropped.

    Both ends are sampled once a tick: a message of tick j with the delay T is delivered at the
    first tick that is not before j dt + T.

    Args:
        line: Keys of the line in the scene.
        dt: Length of a tick in [s].
        seed: Seed of the scene.
        channel: Kind of its messages.
        arm: Index of the arm in a batch.
    """

    def __init__(
        self, line: schema.Line, dt: float, seed: int, channel: Channel, arm: int = 0
    ) -> None:
        self._delay, self._jitter = line.delay / dt - _ROUNDING, line.jitter / dt
        self._loss = line.loss
        self._chance = Chance(seed, channel, uniform(2), arm)
        self._is_random = bool(line.jitter or line.loss)
        self._waiting: deque[tuple[int, T]] = deque()  # sorted by arrival, hence by age
        self._newest: T | None = None

    def restart(self, received: T | None = None) -> None:
        """Discard messages in transit; ``received`` has arrived already."""
        self._waiting.clear()
        self._newest = received

    def send(self, tick: int, message: T) -> None:
        """Send a message; ticks must not decrease."""
        jitter = 0.0
        if self._is_random:
            lost, jitter = self._chance.at(tick).tolist()
            if lost < self._loss:
                return
        arrival = tick + max(0, ceil(self._delay + self._jitter * jitter))
        while self._waiting and self._waiting[-1][0] >= arrival:
            self._waiting.pop()  # overtaken
        self._waiting.append((arrival, message))

    def receive(self, tick: int) -> T | None:
        """The newest message that has arrived by a tick; None if none has."""
        waiting = self._waiting
        while waiting and waiting[0][0] <= tick:
            self._newest = waiting.popleft()[1]
        return self._newest

    def carry(self, tick: int, message: T) -> T | None:
        """Send, and receive in the same tick."""
        self.send(tick, message)
        return self.receive(tick)


def command_line[T](scene: Scene, dt: float, arm: int = 0) -> Line[T] | None:
    """The line of a scene's commands; None if they arrive immediately."""
    if scene.commands is None or scene.commands.perfect:
        return None
    seed = scene.sensors.seed if scene.sensors else 0
    return Line(scene.commands, dt, seed, Channel.COMMANDS, arm)


def delivered(scene: Scene, dt: float, commands: Array) -> Array:
    """Commands of many arms as they arrive, each from its tick 0 on.

    Args:
        scene: The scene of the line.
        dt: Length of a tick in [s].
        commands: Commands by arm and tick, shape (b, ticks, n).

    Returns:
        Effective commands, of the same shape: zero until one has arrived; the commands themselves
        if they arrive immediately.
    """
    if command_line(scene, dt) is None:
        return commands
    effective = np.zeros(commands.shape)
    for arm in range(len(commands)):
        line: Line[int] | None = command_line(scene, dt, arm)
        assert line is not None
        for tick in range(commands.shape[1]):
            if (sent := line.carry(tick, tick)) is not None:
                effective[arm, tick] = commands[arm, sent]
    return effective
