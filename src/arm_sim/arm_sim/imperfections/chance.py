# SPDX-License-Identifier: Apache-2.0
"""Random numbers by tick: the numbers of a tick depend only on its index."""

from collections.abc import Callable
from enum import IntEnum

import numpy as np

from arm_dynamics.arrays import Array

_BLOCK = 64  # number of ticks whose numbers are drawn together
_ARMS = 1 << 32  # more than a batch has: channel and arm are one number of the key


class Channel(IntEnum):
    """Purpose of random numbers; every channel has its own."""

    POSITION = 0
    VELOCITY = 1
    EFFORT = 2
    STATES = 3
    COMMANDS = 4


# Draws the numbers of some ticks in a row, shape (ticks, size)
Draw = Callable[[np.random.Generator, int], Array]


class Chance:
    """Random numbers of one channel of one arm.

    They come from a counter-based generator (Philox 4x64-10; Salmon, Moraes, Dror and Shaw,
    "Parallel random numbers: as easy as 1, 2, 3", SC 2011) whose key is seed, arm and channel and
    whose counter is the tick's: so they do not depend on earlier draws, threads or SIMD lanes.

    Args:
        seed: Seed of the scene.
        channel: Purpose of the numbers.
        draw: Draws numbers of their distribution.
        arm: Index of the arm in a batch; 0 is that of a simulator.
    """

    def __init__(self, seed: int, channel: Channel, draw: Draw, arm: int = 0) -> None:
        self._key, self._draw = [seed, channel * _ARMS + arm], draw
        self._first, self._rows = -_BLOCK, np.empty((0, 0))

    def at(self, tick: int) -> Array:
        """The numbers of a tick, shape (size,)."""
        k = tick - self._first
        if not 0 <= k < _BLOCK:
            block, k = divmod(tick, _BLOCK)
            # A block leaves the lowest word of the counter to the generator.
            philox = np.random.Philox(key=self._key, counter=[0, block, 0, 0])
            self._rows = self._draw(np.random.Generator(philox), _BLOCK)
            self._first = block * _BLOCK
        row: Array = self._rows[k]
        return row


def normal(mean: Array, deviation: Array) -> Draw:
    """White noise around a mean, shape (size,) both."""
    return lambda generator, ticks: (
        mean + deviation * generator.standard_normal((ticks, len(mean)))
    )


def uniform(size: int) -> Draw:
    """Uniform numbers in [0, 1)."""
    return lambda generator, ticks: generator.random((ticks, size))
