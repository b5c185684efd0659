# SPDX-License-Identifier: Apache-2.0
"""Lines that carry messages from tick to tick: late, unevenly late, some of them never."""

from __future__ import annotations

from collections import deque
from math import ceil

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.scene import Scene
from arm_dynamics.scene import imperfections as schema
from arm_sim.imperfections.chance import Chance, Channel, even

_ROUNDED = 1e-6  # of a tick


class Line[T]:
    """Brings the newest message that has arrived; one that was overtaken never shows.

    Both ends look once a tick: a message of tick j that takes the time T shows at the first tick
    that is not before j dt + T.

    Args:
        line: What the scene says of it.
        dt: Length of a tick in [s].
        seed: Of the scene.
        channel: What it carries.
        arm: Which arm of a batch.
    """

    def __init__(
        self, line: schema.Line, dt: float, seed: int, channel: Channel, arm: int = 0
    ) -> None:
        self._delay, self._jitter = line.delay / dt - _ROUNDED, line.jitter / dt
        self._loss = line.loss
        self._chance = Chance(seed, channel, even(2), arm)
        self._draws = bool(line.jitter or line.loss)
        self._waiting: deque[tuple[int, T]] = deque()  # by arrival, which is by age as well
        self._newest: T | None = None

    def restart(self, known: T | None = None) -> None:
        """Forget what is on the way; ``known`` has arrived already."""
        self._waiting.clear()
        self._newest = known

    def send(self, tick: int, message: T) -> None:
        """Put a message on the way; ticks must not go backwards."""
        late = 0.0
        if self._draws:
            lost, late = self._chance.at(tick).tolist()
            if lost < self._loss:
                return
        arrival = tick + max(0, ceil(self._delay + self._jitter * late))
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
    """The line of a scene's commands; None if they arrive at once."""
    if scene.commands is None or scene.commands.perfect:
        return None
    seed = scene.sensors.seed if scene.sensors else 0
    return Line(scene.commands, dt, seed, Channel.COMMANDS, arm)


def delivered(scene: Scene, dt: float, commands: Array) -> Array:
    """What arrives of the commands of many arms, each from its tick 0 on.

    Args:
        scene: Whose line it is.
        dt: Length of a tick in [s].
        commands: By arm and tick, shape (b, ticks, n).

    Returns:
        What acts, of the same shape: zero until something has arrived; the commands themselves if
        they arrive at once.
    """
    if command_line(scene, dt) is None:
        return commands
    late = np.zeros(commands.shape)
    for arm in range(len(commands)):
        line: Line[int] | None = command_line(scene, dt, arm)
        assert line is not None
        for tick in range(commands.shape[1]):
            if (sent := line.carry(tick, tick)) is not None:
                late[arm, tick] = commands[arm, sent]
    return late
