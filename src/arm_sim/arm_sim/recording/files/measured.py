# SPDX-License-Identifier: Apache-2.0
"""Recordings of robots: joint states of a bag, or a table."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_sim.recording.contents import Contents, Event
from arm_sim.recording.files.headers import Column, read_header
from arm_sim.recording.files.messages import JOINT_STATE, PARTS, read
from arm_sim.recording.files.reader import BagContents, BagMessage
from arm_sim.recording.files.table import Table, value

Indices = NDArray[np.int_]
_APART = 5e7  # [ns] between clocks that are not the same one
_SAMPLES = 16  # messages of a topic by which it is chosen
_HOLE = 4.0  # median steps between two messages across which values are not interpolated
_ECHO = (
    "a table without a header, unless from `ros2 topic echo --csv`, is not allowed; there: sec, "
    "nanosec, frame, names, as many positions, velocities and efforts, or an empty column of each"
)


def from_bag(bag: BagContents, topic: str | None, path: Path) -> Contents:
    """Joint states of a topic, in chronological order.

    Args:
        bag: The bag's messages.
        topic: Its name; None for the only topic, or the first of these: one with positions, one
            that is called ``joint_states``, that with most messages.
        path: The bag, for messages.

    Raises:
        InvalidInput: If there is no such topic, or no readable message on it.
    """
    topics, notes = bag.of(JOINT_STATE), list(bag.damage)
    if not topics or topic not in (None, *topics):
        on = "" if topic is None else f" on '{topic}'"
        raise InvalidInput(f"'{path}' has no joint states{on}; it has {bag.listing()}")
    if topic is None:
        topic = max(topics, key=lambda name: _preference(name, topics[name]))
        if len(topics) > 1:
            rest = known_names(name for name in topics if name != topic)
            notes.append(f"joint states are those of {topic}; also recorded: {rest}")
    states, times, errors = list[Any](), list[int](), list[str]()
    for message in topics[topic]:
        try:
            states.append(read(JOINT_STATE, message.data))
            times.append(message.time)
        except InvalidInput as error:
            errors.append(str(error))
    if not states:
        raise InvalidInput(f"'{path}' has no message on '{topic}' that can be read")
    if not any(np.isfinite(state.position).any() for state in states):
        notes.append(f"the messages on {topic} have no positions")
    if errors:
        notes.append(f"{len(errors)} messages could not be read: {errors[0]}")
    return replace(_contents(states, times, notes), left=bag.besides(topic))


def _preference(name: str, messages: list[BagMessage]) -> tuple[bool, bool, int]:
    """Whether some of its messages have positions and it has the usual name, and their number."""
    moves = False
    for message in messages[:: len(messages) // _SAMPLES + 1]:
        with suppress(InvalidInput):
            moves |= bool(np.isfinite(read(JOINT_STATE, message.data).position).any())
    return moves, name.endswith("joint_states"), len(messages)


def _contents(states: list[Any], times: list[int], notes: list[str]) -> Contents:
    """Rows at the times of the joints that most messages name.

    Joints that only other messages name are interpolated to these times.
    """
    kinds: dict[frozenset[str], list[int]] = {}
    for i, state in enumerate(states):
        kinds.setdefault(frozenset(state.name), []).append(i)
    groups, joints, notes = list[Indices](), frozenset[str](), [*notes]
    for own, members in sorted(kinds.items(), key=lambda item: -len(item[1])):
        if own <= joints:
            notes.append(f"{len(members)} messages name no further joint than others")
            continue
        groups.append(np.array(members))
        joints |= own
    if not groups:
        raise InvalidInput("the joint states name no joints")
    stamps = _clock(states, np.array(times, np.int64), groups, notes)
    first, *rest = (_series(states, stamps, group) for group in groups)
    names, parts = first.names, first.parts
    for series in rest:
        new = [i for i, name in enumerate(series.names) if name not in names]
        added = tuple(series.names[i] for i in new)
        notes.append(
            f"{known_names(added)}: from {len(series.time)} messages of their own, interpolated "
            f"to the times of {known_names(names)}"
        )
        parts = [
            np.hstack([part, _interpolated(first.time, series.time, values[:, new])])
            for part, values in zip(parts, series.parts, strict=True)
        ]
        names += added
    used = sum(len(series.time) for series in (first, *rest))
    if repeated := sum(map(len, groups)) - used:
        notes.append(f"{repeated} messages have the time of another one")
    return _recorded(1e-9 * (first.time - first.time[0]), names, parts, notes)


def _clock(
    states: list[Any], arrived: NDArray[np.int64], groups: list[Indices], notes: list[str]
) -> NDArray[np.int64]:
    """Time of each message in [ns]: its stamp, or that of arrival where stamps are of no use."""
    times = np.array([state.stamp for state in states], np.int64)
    for group in groups:
        if not np.all(np.diff(times[group]) > 0):
            times[group] = arrived[group]
            names = known_names(states[group[0]].name)
            notes.append(f"{names}: stamps do not increase, times are those of arrival")
    apart = np.ptp([np.median(arrived[group] - times[group]) for group in groups])
    spans = [np.ptp(clock[groups[0]]) for clock in (arrived, times)]
    if apart > _APART and abs(spans[0] - spans[1]) < 0.1 * spans[1]:
        notes.append(f"clocks of joints are {1e-9 * apart:.3g} s apart, times are of arrival")
        return arrived
    return times


class _Series(NamedTuple):
    """Messages of the same joints, in order of time."""

    names: tuple[str, ...]
    time: NDArray[np.int64]  # [ns], shape (k,)
    parts: list[Array]  # as ``PARTS``, each of shape (k, n)


def _series(states: list[Any], stamps: NDArray[np.int64], group: Indices) -> _Series:
    rows = group[np.argsort(stamps[group], kind="stable")]
    unique = rows[np.diff(stamps[rows], prepend=stamps[rows[0]] - 1) > 0]
    names, parts = states[group[0]].name, list[Array]()
    for part in PARTS:
        values = np.full((len(unique), len(names)), np.nan)
        for row, state in zip(values, (states[row] for row in unique), strict=True):
            numbers = getattr(state, part)
            if len(numbers) == len(names):
                row[:] = numbers[[state.name.index(name) for name in names]]
        parts.append(values)
    return _Series(names, stamps[unique], parts)


def _interpolated(times: NDArray[np.int64], own: NDArray[np.int64], values: Array) -> Array:
    """Values of ``own`` times at others; NaN where no two of them on either side are near."""
    interpolated = np.full((len(times), values.shape[1]), np.nan)
    if len(own) > 1:
        after = np.clip(np.searchsorted(own, times), 1, len(own) - 1)
        steps = np.diff(own)
        share = (times - own[after - 1]) / steps[after - 1]
        near = (share >= 0.0) & (share <= 1.0) & (steps[after - 1] <= _HOLE * np.median(steps))
        last, share = after[near], share[near, None]
        interpolated[near] = (1.0 - share) * values[last - 1] + share * values[last]
    return interpolated


def from_table(path: Path) -> Contents:
    """Read a CSV file: columns such as ``position.NAME``, see ``read_header``, or messages.

    Raises:
        InvalidInput: If it is not such a file.
    """
    table = Table.read(path)
    if not table.names:
        states = [_echoed(table, row) for row in range(len(table.rows))]
        return _contents(states, [state.stamp for state in states], table.notes)
    header = read_header(table.names)
    if header.clock is None or not header.joints:
        raise InvalidInput(
            f"'{path}' has columns {known_names(table.names)}; 'time', 'position.NAME' and, where "
            "they are known, 'velocity.NAME' and 'effort.NAME' are expected"
        )

    def of(column: Column | None) -> Array:
        if column is None:
            return np.full(len(table.rows), np.nan)
        return column.factor * table.numbers(column.place)

    time = table.times(header.clock.place, header.clock.factor)
    columns = [[header.columns.get((part, joint)) for joint in header.joints] for part in PARTS]
    parts = [np.column_stack([*map(of, row)]) for row in columns]
    used = {header.clock.place, *(column.place for row in columns for column in row if column)}
    unused = [name or "without a name" for i, name in enumerate(table.names) if i not in used]
    notes = [f"columns that are not used: {known_names(unused)}"] if unused else []
    return _recorded(time, header.joints, parts, [*table.notes, *notes])


def to_table(contents: Contents, efforts: Array, path: Path) -> None:
    """Write joint states as a table that ``from_table`` reads."""
    header = ["time", *(f"{part}.{joint}" for part in PARTS for joint in contents.joint_names)]
    rows = np.column_stack([contents.time, contents.q, contents.v, efforts])
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *rows.tolist()])


def _echoed(table: Table, row: int) -> Any:
    """A joint state as ``ros2 topic echo --csv`` prints it; an empty cell is an absent part."""
    cells, parts = table.rows[row], list[Array]()
    stamp = [int(cell) for cell in cells[:2] if cell.isdecimal() and len(cell) < 11]
    names = tuple(takewhile(lambda cell: value(cell) is None, cells[3:]))
    at = 3 + len(names)
    for _ in PARTS:
        size = len(names) if any(cells[at : at + 1]) else 1
        numbers = [value(cell) for cell in cells[at : at + size]]
        if None in numbers:
            raise table.error(row, at + numbers.index(None), _ECHO)
        parts.append(np.array(numbers, float))
        at += size
    if len(stamp) < 2 or not names or at != len(cells):
        raise table.error(row, len(cells) - 1 if len(stamp) == 2 else 0, _ECHO)
    joints = dict(zip(PARTS, parts, strict=True))
    return SimpleNamespace(stamp=10**9 * stamp[0] + stamp[1], name=names, **joints)


def _recorded(
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
