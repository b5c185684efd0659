# SPDX-License-Identifier: Apache-2.0
"""Whether recorded stamps are evenly spaced, and whether recorded commands paused."""

from __future__ import annotations

import struct
from array import array
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from arm_dynamics.arrays import Array

_STAMP = struct.Struct("<iI")
UNEVEN = 0.01  # of the period
MADE_UP = 5.0  # [s] within which stamps make up for ticks that were dropped
PAUSE = 0.09  # [s] without an answer after which the next tick may find the last one stale


@dataclass(frozen=True)
class Messages:
    """Messages of one topic, in order of arrival.

    Attributes:
        at: Times of arrival in [s] of the system's clock, shape (k,).
        stamps: In [ns], shape (k,).
    """

    at: Array
    stamps: Array


def recorded(path: Path) -> dict[str, Messages]:
    """The messages of a recording by topic; each begins with a header."""
    found: dict[str, array[int]] = defaultdict(lambda: array("q"))
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            seconds, nanoseconds = _STAMP.unpack_from(message.data, 4)
            found[channel.topic].extend((message.log_time, 10**9 * seconds + nanoseconds))
    tables = {topic: np.array(times).reshape(-1, 2).T for topic, times in found.items()}
    return {topic: Messages(1e-9 * at, stamps) for topic, (at, stamps) in tables.items()}


def uneven(stamps: Array, period: int) -> Array:
    """Indices of stamps whose distance from those before is no multiple of the period, nor zero.

    A multiple: messages were lost on the way. Zero: time stands still.

    Args:
        stamps: In [ns], shape (k,).
        period: In [ns].
    """
    steps = np.diff(stamps)
    periods = np.maximum(np.round(steps / period), 1.0)
    return np.flatnonzero((np.abs(steps - periods * period) > UNEVEN * period) & (steps != 0)) + 1


def unexplained(at: Array, dropped: Sequence[tuple[float, float]]) -> int:
    """How many of some times are not in intervals of dropped ticks, or while they are made up for.

    Args:
        at: The times in [s].
        dropped: The intervals in [s].
    """
    told = [(begin <= at) & (at <= end + MADE_UP) for begin, end in dropped]
    return int(np.sum(~np.any(told, axis=0))) if told else len(at)


def paused(commands: Messages, begin: float, end: float) -> bool:
    """Whether no command answered states for ``PAUSE`` in an interval in [s].

    Nothing arrived for that long, and the states that were passed over are that far apart: if the
    listener was late, the stamps tell.
    """
    silent = (np.diff(commands.at) > PAUSE) & (np.diff(commands.stamps) > 1e9 * PAUSE)
    return bool(np.any(silent & (commands.at[1:] >= begin) & (commands.at[1:] <= end)))
