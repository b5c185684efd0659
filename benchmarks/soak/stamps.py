# SPDX-License-Identifier: Apache-2.0
"""Whether recorded stamps are evenly spaced, and whether recorded commands paused."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zstandard
from mcap.records import Channel, Chunk, MessageIndex
from mcap.stream_reader import StreamReader

from arm_dynamics.arrays import Array
from arm_sim.recording.files import MESSAGE

_STAMP = MESSAGE.size + 4  # bytes from a record's beginning to its message's stamp
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
    """The messages of a recording of ours by topic; each begins with a header."""
    names, found = dict[int, str](), defaultdict[str, list[Array]](list)
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Channel):
                names[record.id] = record.topic
            elif isinstance(record, Chunk):
                data = zstandard.decompress(record.data, max_output_size=record.uncompressed_size)
                rows = np.frombuffer(data, np.uint8)
            elif isinstance(record, MessageIndex):
                times, places = np.array(record.records, np.int64).T
                stamps = rows[places[:, None] + _STAMP + np.arange(8)].view(np.int32)
                found[names[record.channel_id]].append(np.column_stack([times, stamps]))
    tables = {topic: np.concatenate(pieces).T for topic, pieces in found.items()}
    return {
        topic: Messages(1e-9 * at, 10**9 * seconds + nanoseconds)
        for topic, (at, seconds, nanoseconds) in tables.items()
    }


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
    """Whether no command arrived for ``PAUSE`` in an interval in [s]."""
    silent = np.diff(commands.at) > PAUSE
    return bool(np.any(silent & (commands.at[1:] >= begin) & (commands.at[1:] <= end)))
