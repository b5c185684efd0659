# SPDX-License-Identifier: Apache-2.0
"""Recordings of robots: joint states of a bag, or a table."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_sim.recording.contents import Contents, Event
from arm_sim.recording.files.bags import told
from arm_sim.recording.files.container import FileContents
from arm_sim.recording.files.headers import PARTS, Column, read_header
from arm_sim.recording.files.messages import JOINT_STATE, JointStates

_SEPARATORS = (",", ";", "\t")


def from_bag(found: FileContents, topic: str | None, where: Path) -> Contents:
    """Joint states of a topic, in chronological order.

    Args:
        found: The bag's messages.
        topic: Its name; None for the only topic, or that with most messages.
        where: The bag, for messages.

    Raises:
        InvalidInput: If there is no such topic, or no readable message on it.
    """
    topics = found.of(JOINT_STATE)
    if topic is not None and topic not in topics:
        raise InvalidInput(f"'{where}' has no joint states on '{topic}'; it has {told(found)}")
    if not topics:
        raise InvalidInput(f"'{where}' has no joint states; it has {told(found)}")
    chosen = topic or max(topics, key=lambda name: len(topics[name]))
    states, times, refused = list[JointStates](), list[int](), list[str]()
    for _, time, raw in topics[chosen]:
        try:
            states.append(JointStates.read(raw))
            times.append(time)
        except InvalidInput as error:
            refused.append(str(error))
    if not states:
        raise InvalidInput(f"'{where}' has no message on '{chosen}' that can be read")
    notes = list(found.damage)
    if refused:
        notes.append(f"{len(refused)} messages could not be read: {refused[0]}")
    return _contents(states, times, notes)


def _contents(states: list[JointStates], times: list[int], notes: list[str]) -> Contents:
    """Rows of the joints that most messages name; messages of other joints are ignored."""
    kinds: dict[frozenset[str], int] = {}
    for state in states:
        kinds[frozenset(state.names)] = kinds.get(frozenset(state.names), 0) + 1
    common = max(kinds, key=lambda names: kinds[names])
    kept = [(s, t) for s, t in zip(states, times, strict=True) if frozenset(s.names) == common]
    if len(kept) < len(states):
        notes = [*notes, f"{len(states) - len(kept)} messages name other joints"]
    names = kept[0][0].names
    stamps = np.array([state.stamp for state, _ in kept], np.int64)
    if not np.all(np.diff(stamps) > 0):  # a robot without a clock: only arrival times are known
        stamps = np.array([time for _, time in kept], np.int64)
    rows = np.argsort(stamps, kind="stable")
    once = rows[np.diff(stamps[rows], prepend=stamps[rows[0]] - 1) > 0]
    if len(once) < len(rows):
        notes = [*notes, f"{len(rows) - len(once)} messages have the time of another one"]
    time = 1e-9 * (stamps[once] - stamps[once[0]])
    places = [[state.names.index(name) for name in names] for state, _ in kept]
    parts = [
        np.array([_numbers(getattr(state, part), place)
                  for (state, _), place in zip(kept, places, strict=True)])[once]
        for part in PARTS
    ]  # fmt: skip
    return made(time, names, parts, notes)


def _numbers(values: Array, places: list[int]) -> Array:
    if len(values) != len(places):
        return np.full(len(places), np.nan)
    return np.asarray(values[places], float)


def from_table(path: Path) -> Contents:
    """Read a CSV file with columns such as ``time`` and ``position.NAME``; see ``read_header``.

    Raises:
        InvalidInput: If it is not such a file.
    """
    names, values = read_table(path)
    header = read_header(names)
    if header.clock is None or not header.joints:
        raise InvalidInput(
            f"'{path}' has columns {known_names(names)}; 'time', 'position.NAME' and, where "
            "they are known, 'velocity.NAME' and 'effort.NAME' are expected"
        )

    def of(column: Column | None) -> Array:
        if column is None:
            return np.full(len(values), np.nan)
        return np.asarray(values[:, column.place] * column.factor)

    time = of(header.clock)
    if not np.isfinite(time).all() or not np.all(np.diff(time) > 0.0):
        raise InvalidInput(
            f"'{path}': column '{names[header.clock.place]}' does not increase from row to row"
        )
    parts = [
        np.column_stack([of(header.columns.get((part, joint))) for joint in header.joints])
        for part in PARTS
    ]
    return made(time, header.joints, parts, [])


def read_table(path: Path) -> tuple[list[str], Array]:
    """Read the header and the numbers of a CSV file; empty cells are NaN.

    Raises:
        InvalidInput: If it has no rows, a row of another length than the header, or words.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            first = file.readline()
            between = max(_SEPARATORS, key=first.count)
            file.seek(0)
            reader = csv.reader(file, delimiter=between)
            lines = [(reader.line_num, row) for row in reader if row]
        if len(lines) < 2:
            raise ValueError("it has no rows below a header")
        names = lines[0][1]
        for line, row in lines:
            if len(row) != len(names):
                raise ValueError(f"line {line} has {len(row)} columns, the header {len(names)}")
        return names, np.array([[float(word or "nan") for word in row] for _, row in lines[1:]])
    except (ValueError, UnicodeDecodeError, csv.Error) as error:
        raise InvalidInput(f"'{path}' is not a table of numbers: {error}") from None


def made(
    time: Array, names: tuple[str, ...], parts: Sequence[Array], notes: list[str]
) -> Contents:
    """A measured recording of positions, velocities and efforts."""
    rows, (q, v, effort) = len(time), parts
    return Contents(
        time=read_only(time), q=read_only(q), v=read_only(v), z=read_only(np.zeros((rows, 0))),
        command=read_only(effort), local_error=read_only(np.zeros(rows)),
        time_stepped=read_only(np.zeros(rows)), joint_names=names,
        p=read_only(np.zeros((rows, 0))),
        events=tuple(Event(float(time[-1]), f"file: {note}") for note in notes), of_robot=True,
    )  # fmt: skip
