# SPDX-License-Identifier: Apache-2.0
"""Recordings of robots: joint states of a bag, or a table."""

import csv
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_sim.recording.contents import Contents, Event
from arm_sim.recording.files.headers import Column, read_header
from arm_sim.recording.files.merging import HOLE, merged
from arm_sim.recording.files.messages import JOINT_STATE, PARTS, JointState, read_joint_state
from arm_sim.recording.files.reader import BagContents, BagMessage
from arm_sim.recording.files.table import Table, value

_SAMPLES = 16  # messages of a topic by which it is chosen
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
    states, times, errors = list[JointState](), list[int](), list[str]()
    for message in topics[topic]:
        try:
            states.append(read_joint_state(message.data))
            times.append(message.time)
        except InvalidInput as error:
            errors.append(str(error))
    if not states:
        raise InvalidInput(f"'{path}' has no message on '{topic}' that can be read")
    if not any(np.isfinite(state.position).any() for state in states):
        notes.append(f"the messages on {topic} have no positions")
    if errors:
        notes.append(f"{len(errors)} messages could not be read: {errors[0]}")
    return replace(_merged(states, times, notes), left=bag.besides(topic))


def _preference(name: str, messages: list[BagMessage]) -> tuple[bool, bool, int]:
    """Whether some of its messages have positions and it has the usual name, and their number."""
    has_positions = False
    for message in messages[:: len(messages) // _SAMPLES + 1]:
        with suppress(InvalidInput):
            position = read_joint_state(message.data).position
            has_positions |= bool(np.isfinite(position).any())
    return has_positions, name.endswith("joint_states"), len(messages)


def from_table(path: Path) -> Contents:
    """Read a CSV file: columns such as ``position.NAME``, see ``read_header``, or messages.

    Raises:
        InvalidInput: If it is not such a file.
    """
    table = Table.read(path)
    if not table.names:
        states = [_echoed(table, row) for row in range(len(table.rows))]
        return _merged(states, [state.stamp for state in states], table.notes)
    header = read_header(table.names)
    if header.clock is None or not header.joints:
        raise InvalidInput(
            f"'{path}' has columns {known_names(table.names)}; 'time', 'position.NAME' and, where "
            "they are known, 'velocity.NAME' and 'effort.NAME' are expected, or what 'ros2 topic "
            "echo --csv' prints; of a bag of ROS 1, rosbags-convert makes one of ROS 2"
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


def _echoed(table: Table, row: int) -> JointState:
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
    return JointState(10**9 * stamp[0] + stamp[1], names, *parts)


def _merged(states: list[JointState], arrival: list[int], notes: list[str]) -> Contents:
    series, more = merged(states, arrival)
    time = 1e-9 * (series.time - series.time[0])
    return _recorded(time, series.names, series.parts, [*notes, *more])


def _recorded(
    time: Array, names: tuple[str, ...], parts: Sequence[Array], notes: list[str]
) -> Contents:
    """A measured recording of positions, velocities and efforts."""
    rows, (q, v, effort) = len(time), parts
    steps = np.diff(time, prepend=time[0])  # in median steps
    steps /= np.median(steps[1:]) if rows > 1 else 1.0
    gaps = np.flatnonzero(steps > HOLE)
    if missing := round(sum(steps[gaps] - 1.0)):
        notes = [*notes, f"{missing} joint states are missing by their times, in {len(gaps)} gaps"]
    return Contents(
        time=read_only(time), q=read_only(q), v=read_only(v), z=read_only(np.zeros((rows, 0))),
        command=read_only(effort), local_error=read_only(np.zeros(rows)),
        time_stepped=read_only(np.zeros(rows)), joint_names=names,
        p=read_only(np.zeros((rows, 0))), gaps=tuple(gaps.tolist()),
        events=tuple(Event(float(time[-1]), f"file: {note}") for note in notes), of_robot=True,
    )  # fmt: skip
