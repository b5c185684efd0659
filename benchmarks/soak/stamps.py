# SPDX-License-Identifier: Apache-2.0
"""Whether recorded stamps are evenly spaced, and whether recorded commands had paused."""

from __future__ import annotations

import re
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
PAUSE = 0.09  # [s] without a command after which the next tick may find the last one stale
READING = 0.02  # [s] without any message after which the recorder itself is being held up
LOGGED = 0.5  # [s] within which a tick's warning is in the log, on a machine that is busy
_WARNING = re.compile(r"^\[WARN\] \[(\d+\.\d+)\] \[[^\]]*\]: no command for", re.MULTILINE)


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


def warnings(log: str) -> list[float]:
    """Times in [s] of the system's clock at which a simulation's log calls commands stale."""
    return [float(at) for at in _WARNING.findall(log)]


def answers(commands: Messages) -> Messages:
    """The commands that answer a state; those of an intruder have no stamp."""
    answering = commands.stamps != 0
    return Messages(commands.at[answering], commands.stamps[answering])


def had_paused(commands: Messages, heard: Array, warned: float) -> bool:
    """Whether commands had paused when a warning said that they are stale.

    They must not have come for ``PAUSE`` while the recorder was reading, as messages of other
    topics show: what it has read late is no pause. And the pause must have lasted until ``LOGGED``
    before the warning at least. Or no state of ``PAUSE`` was answered, whenever the recorder read
    the answers to those before and after: each was sent after it had last read anything.

    Args:
        commands: The commands.
        heard: When the recorder read anything, in [s], shape (k,), increasing.
        warned: When the warning was logged, in [s].
    """
    reading = np.append(0.0, np.cumsum(np.minimum(np.diff(heard), READING)))
    ends = np.append(commands.at[1:], heard[-1])
    lasted = np.interp(ends, heard, reading) - np.interp(commands.at, heard, reading)
    unanswered = 1e-9 * np.append(np.diff(commands.stamps), 0.0)
    not_over = ends > warned - LOGGED
    silent = (commands.at <= warned) & (lasted > PAUSE)
    before = np.maximum(np.searchsorted(heard, commands.at) - 1, 0)
    skipped = (heard[before] <= warned) & (unanswered > PAUSE)
    return bool(np.any(not_over & (silent | skipped)))
