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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_sim.recording.contents import Contents, Event
from arm_sim.recording.files.headers import Column, read_elements, read_header
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


def from_bag(found: BagContents, topic: str | None, where: Path) -> Contents:
    """Joint states of a topic, in chronological order.

    Args:
        found: The bag's messages.
        topic: Its name; None for the only topic, or the first of these: one with positions, one
            that is called ``joint_states``, that with most messages.
        where: The bag, for messages.

    Raises:
        InvalidInput: If there is no such topic, or no readable message on it.
    """
    topics = found.of(JOINT_STATE)
    if not topics or topic not in (None, *topics):
        on = "" if topic is None else f" on '{topic}'"
        raise InvalidInput(f"'{where}' has no joint states{on}; it has {found.listing()}")
    chosen = topic or max(topics, key=lambda name: _preference(name, topics[name]))
    states, times, refused = list[Any](), list[int](), list[str]()
    for _, time, raw in topics[chosen]:
        try:
            states.append(read(JOINT_STATE, raw))
            times.append(time)
        except InvalidInput as error:
            refused.append(str(error))
    if not states:
        raise InvalidInput(f"'{where}' has no message on '{chosen}' that can be read")
    notes = list(found.damage)
    if topic is None and len(topics) > 1:
        others = known_names(name for name in topics if name != chosen)
        notes.append(f"joint states are those of {chosen}; also recorded: {others}")
    if not any(np.isfinite(state.position).any() for state in states):
        notes.append(f"the messages on {chosen} have no positions")
    if refused:
        notes.append(f"{len(refused)} messages could not be read: {refused[0]}")
    return replace(_contents(states, times, notes), left=found.besides(chosen))


def _preference(name: str, messages: list[BagMessage]) -> tuple[bool, bool, int]:
    """Whether some of its messages have positions and it has the usual name, and their number."""
    moves = False
    for _, _, raw in messages[:: len(messages) // _SAMPLES + 1]:
        with suppress(InvalidInput):
            moves |= bool(np.isfinite(read(JOINT_STATE, raw).position).any())
    return moves, name.endswith("joint_states"), len(messages)


def _contents(states: list[Any], times: list[int], notes: list[str]) -> Contents:
    """Rows at the times of the joints that most messages name.

    Joints that only other messages name are interpolated to these times.
    """
    kinds: dict[frozenset[str], list[int]] = {}
    for i, state in enumerate(states):
        kinds.setdefault(frozenset(state.name), []).append(i)
    groups, known, notes = list[Indices](), frozenset[str](), [*notes]
    for own, members in sorted(kinds.items(), key=lambda item: -len(item[1])):
        if own <= known:
            notes.append(f"{len(members)} messages name no further joint than others")
            continue
        groups.append(np.array(members))
        known |= own
    if not groups:
        raise InvalidInput("the joint states name no joints")
    stamps = _clock(states, np.array(times, np.int64), groups, notes)
    (names, at, parts), *others = (_series(states, stamps, group) for group in groups)
    for joints, its, more in others:
        new = [i for i, name in enumerate(joints) if name not in names]
        added = tuple(joints[i] for i in new)
        notes.append(
            f"{known_names(added)}: from {len(its)} messages of their own, interpolated to the "
            f"times of {known_names(names)}"
        )
        parts = [
            np.hstack([part, _interpolated(at, its, values[:, new])])
            for part, values in zip(parts, more, strict=True)
        ]
        names += added
    if twice := sum(map(len, groups)) - len(at) - sum(len(its) for _, its, _ in others):
        notes.append(f"{twice} messages have the time of another one")
    return _recorded(1e-9 * (at - at[0]), names, parts, notes)


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


def _series(
    states: list[Any], stamps: NDArray[np.int64], group: Indices
) -> tuple[tuple[str, ...], NDArray[np.int64], list[Array]]:
    """Joints, times in [ns] and parts of messages of the same joints, in order of time."""
    rows = group[np.argsort(stamps[group], kind="stable")]
    once = rows[np.diff(stamps[rows], prepend=stamps[rows[0]] - 1) > 0]
    names, kept = states[group[0]].name, [states[row] for row in once]
    places = [[state.name.index(name) for name in names] for state in kept]
    pairs = [*zip(kept, places, strict=True)]
    parts = [np.array([_numbers(getattr(s, part), place) for s, place in pairs]) for part in PARTS]
    return names, stamps[once], parts


def _interpolated(at: NDArray[np.int64], its: NDArray[np.int64], values: Array) -> Array:
    """Values at other times; NaN where no two of their own on either side are near."""
    found = np.full((len(at), values.shape[1]), np.nan)
    if len(its) > 1:
        after = np.clip(np.searchsorted(its, at), 1, len(its) - 1)
        steps = np.diff(its)
        share = (at - its[after - 1]) / steps[after - 1]
        near = (share >= 0.0) & (share <= 1.0) & (steps[after - 1] <= _HOLE * np.median(steps))
        last, share = after[near], share[near, None]
        found[near] = (1.0 - share) * values[last - 1] + share * values[last]
    return found


def _numbers(values: Array, places: list[int]) -> Array:
    if len(values) != len(places):
        return np.full(len(places), np.nan)
    return np.asarray(values[places], float)


def from_table(path: Path) -> Contents:
    """Read a CSV file: columns such as ``position.NAME``, see ``read_header``, or messages.

    Raises:
        InvalidInput: If it is not such a file.
    """
    table = Table.read(path)
    if not table.names:
        states = [_echoed(table, row) for row in range(len(table.rows))]
        return _contents(states, [state.stamp for state in states], table.notes)
    header, elements = read_header(table.names), read_elements(table.names)
    if header.clock is None or not (header.joints or elements):
        raise InvalidInput(
            f"'{path}' has columns {known_names(table.names)}; 'time', 'position.NAME' and, where "
            "they are known, 'velocity.NAME' and 'effort.NAME' are expected"
        )
    if elements:
        return _contents(*_messages(table, elements, header.clock), table.notes)

    def of(column: Column | None) -> Array:
        if column is None:
            return np.full(len(table.rows), np.nan)
        return column.factor * table.numbers(column.place)

    time = table.times(header.clock.place, header.clock.factor)
    wanted = [[header.columns.get((part, joint)) for joint in header.joints] for part in PARTS]
    parts = [np.column_stack([*map(of, columns)]) for columns in wanted]
    used = {header.clock.place, *(column.place for row in wanted for column in row if column)}
    unused = [name or "without a name" for i, name in enumerate(table.names) if i not in used]
    notes = [f"columns that are not used: {known_names(unused)}"] if unused else []
    return _recorded(time, header.joints, parts, [*table.notes, *notes])


def to_table(contents: Contents, efforts: Array, path: Path) -> None:
    """Write joint states as a table that ``from_table`` reads."""
    header = ["time", *(f"{part}.{joint}" for part in PARTS for joint in contents.joint_names)]
    rows = np.column_stack([contents.time, contents.q, contents.v, efforts])
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *rows.tolist()])


def _messages(
    table: Table, elements: dict[tuple[str, int], int], clock: Column
) -> tuple[list[Any], list[int]]:
    """Joint states whose names are in cells, as of ``rostopic echo -p``, and their arrival."""
    stamp = [i for i, name in enumerate(table.names) if name.endswith("header.stamp")]
    arrived = _nanoseconds(table, clock.place, clock.factor)
    stamps = _nanoseconds(table, stamp[0], 1e-9) if stamp else arrived
    numbers = {key: table.numbers(place) for key, place in elements.items() if key[0] != "name"}
    states, none = list[Any](), np.full(len(stamps), np.nan)
    for row, cells in enumerate(table.rows):
        own = {i: cells[at] for (field, i), at in elements.items() if field == "name"}
        places = sorted(i for i, name in own.items() if name)
        parts = [np.array([numbers.get((p, i), none)[row] for i in places]) for p in PARTS]
        states.append(_state(stamps[row], tuple(own[i] for i in places), parts))
    return states, arrived


def _nanoseconds(table: Table, column: int, factor: float) -> list[int]:
    return [round(1e9 * factor * time) for time in table.stamps(column, factor).tolist()]


def _state(stamp: int, names: tuple[str, ...], parts: list[Array]) -> Any:
    """As a joint state that was read."""
    return SimpleNamespace(stamp=stamp, name=names, **dict(zip(PARTS, parts, strict=True)))


def _echoed(table: Table, row: int) -> Any:
    """A row of ``ros2 topic echo --csv``: stamp, frame, names, then each part or an empty cell."""
    cells, parts = table.rows[row], list[Array]()
    stamp = [int(cell) for cell in cells[:2] if cell.isdecimal() and len(cell) < 11]
    names = tuple(takewhile(lambda cell: value(cell) is None, cells[3:]))
    at = 3 + len(names)
    for _ in PARTS:
        size = len(names) if any(cells[at : at + 1]) else 1
        found = [value(cell) for cell in cells[at : at + size]]
        if None in found:
            raise table.error(row, at + found.index(None), _ECHO)
        parts.append(np.array(found, float))
        at += size
    if len(stamp) < 2 or not names or at != len(cells):
        raise table.error(row, len(cells) - 1 if len(stamp) == 2 else 0, _ECHO)
    return _state(10**9 * stamp[0] + stamp[1], names, parts)


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
