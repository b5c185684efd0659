# SPDX-License-Identifier: Apache-2.0
"""Recordings as MCAP: ticks and changes, from which a run can be repeated bit by bit."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.cdr import GIGA
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.scene import Scene
from arm_dynamics.scene.constraint import switches
from arm_dynamics.scene.schema import Tunable
from arm_sim.imperfections import Measured
from arm_sim.plant.placing import held_of
from arm_sim.recording.changes import Jump
from arm_sim.recording.contents import FREE, Contents, Event
from arm_sim.recording.files.container import MESSAGE, FileContents, McapWriter
from arm_sim.recording.files.messages import (
    CHANGE,
    JOINT_STATE,
    LATCHED,
    LOG,
    STRING,
    TICK,
    Change,
    JointStates,
    JointStateWriter,
    TickWriter,
    definition,
    log_message,
    log_text,
    numbers_at,
    stamps_at,
    string_message,
    tick_sizes,
)
from arm_sim.recording.origin import URDF_FILE, Origin

FACTS, FORMAT = "arm_sim", "1"
EXTERNAL, SWITCHES = "external", "constraints"
UNCHANGED = -1.0
"""Sub-step of a change of external torques only."""
_INFO = 20
_ROWS = 500  # ticks per chunk


class TickFile:
    """A file of ticks that is being written.

    Args:
        path: Path of the file.
        origin: Scene and method.
        joint_names: Order of the joints.
        prefix: Prefix of the suite's topics, such as ``/sim``.
        states: Topic of joint states.

    Attributes:
        mcap: The file.
        states: Number of the channel of joint states.
        ticks: Number of that of ticks.
        changes: Number of that of changes.
        log: Number of that of events.
    """

    def __init__(
        self,
        path: Path,
        origin: Origin,
        joint_names: Sequence[str],
        prefix: str = "/sim",
        states: str = "/joint_states",
    ) -> None:
        self.mcap = mcap = McapWriter(path)
        facts = {"format": FORMAT, "joint_names": json.dumps(list(joint_names)), **origin.about()}
        mcap.tell(FACTS, facts)
        texts = origin.texts()
        for name, text in texts.items():
            mcap.attach(name, text)
        self.states = self._channel(states, JOINT_STATE)
        self.ticks = self._channel(f"{prefix}/ticks", TICK)
        self.changes = self._channel(f"{prefix}/changes", CHANGE)
        self.log = self._channel(f"{prefix}/events", LOG)
        folder = states.rpartition("/")[0]
        self._robot = self._channel(f"{folder}/robot_description", STRING, LATCHED)
        self._urdf = texts[URDF_FILE]

    def _channel(self, topic: str, kind: str, profile: str = "") -> int:
        return self.mcap.channel(topic, kind, definition(kind), profile)

    def robot(self) -> tuple[int, bytes]:
        """Channel and message of the robot's description."""
        return self._robot, string_message(self._urdf)


def write(contents: Contents, efforts: Array, path: Path) -> TickFile:
    """Write a recording; return the open file, to be closed by the caller, or appended to.

    Args:
        contents: The recording.
        efforts: Torques on the joints from each time, shape (k+1, n).
        path: Path of the file.

    Raises:
        InvalidInput: If it is not of a simulated scene.
        OSError: If it cannot be written.
    """
    if contents.origin is None:
        raise InvalidInput("the recording is not of a simulated scene")
    file = TickFile(path, contents.origin, contents.joint_names)
    pieces, changes, rows = _Pieces(), dict(_changes(contents)), _rows(contents, efforts, file)
    first = _nanoseconds(contents.time[0])
    pieces.add(*file.robot(), first)
    for event in contents.events:
        stamp = _nanoseconds(event.time)
        pieces.add(file.log, log_message(stamp, _INFO, "sim", event.text), stamp)
    pieces.add(file.changes, changes.pop(0).written(), first)
    pieces.add(file.states, rows.first, first)
    pieces.flush(file.mcap)
    _write_rows(file, contents, changes, rows)
    return file


def append(file: TickFile, contents: Contents, efforts: Array) -> None:
    """Write another recording, which begins where the last one ends; see ``write``."""
    changes, rows = dict(_changes(contents)), _rows(contents, efforts, file)
    if not any(jump.row == 0 for jump in contents.jumps):
        del changes[0]  # the state there is that in which the last one ends
    _write_rows(file, contents, changes, rows)


def _write_rows(
    file: TickFile, contents: Contents, changes: dict[int, Change], rows: _Rows
) -> None:
    """Write ticks, and changes between them."""
    pieces, last, done = _Pieces(), len(contents.time) - 1, 0
    for row in sorted({*changes, *range(_ROWS, last, _ROWS), last}):
        upto = row - 1 if row in contents.gaps else row  # no tick leads across a gap
        file.mcap.chunk(rows.rows[done:upto].tobytes(), rows.offsets(upto - done))
        done = row
        if row in changes:
            pieces.add(file.changes, changes[row].written(), _nanoseconds(contents.time[row]))
            pieces.flush(file.mcap)


class _Pieces:
    """A few messages, one by one."""

    def __init__(self) -> None:
        self._data, self._offsets = bytearray(), list[int]()

    def add(self, channel: int, message: bytes, stamp: int) -> None:
        self._offsets.append(len(self._data))
        self._data += MESSAGE.pack(5, 22 + len(message), channel, 0, stamp, stamp) + message

    def flush(self, mcap: McapWriter) -> None:
        mcap.chunk(bytes(self._data), np.array(self._offsets, np.int64))
        self.__init__()  # type: ignore[misc]


class _Rows:
    """Joint state and tick of every time as records: a matrix of bytes.

    Attributes:
        rows: The records after the first time, shape (k, size of both).
        first: The joint state at the first time.
    """

    def __init__(self, rows: NDArray[np.uint8], starts: Sequence[int]) -> None:
        state = rows[0, starts[0] + MESSAGE.size : starts[1]].tobytes()
        self.first, self.rows, self._starts = state, rows[1:], np.array(starts, np.int64)

    def offsets(self, count: int) -> NDArray[np.int64]:
        """Offsets of the messages of ``count`` rows."""
        size = self.rows.shape[1]
        places: NDArray[np.int64] = np.arange(count, dtype=np.int64)[:, None] * size + self._starts
        return places.ravel()


def _fill(
    rows: NDArray[np.uint8], stamps: NDArray[np.int64], message: JointStateWriter | TickWriter,
    arrays: Sequence[Array], before: int,
) -> None:  # fmt: skip
    """Write times, sequence numbers and arrays into records of a message, one a row."""
    for place in (15, 23):
        _put(rows, place, stamps)
    _put(rows, 11, np.arange(before, before + len(rows)).astype(np.uint32))
    seconds, rest = np.divmod(stamps, GIGA)
    stamp = MESSAGE.size + message.stamp
    _put(rows, stamp, seconds.astype(np.int32))
    _put(rows, stamp + 4, rest.astype(np.uint32))
    for place, array in zip(message.places, arrays, strict=True):
        _put(rows, MESSAGE.size + place, array)


def _rows(contents: Contents, efforts: Array, file: TickFile) -> _Rows:
    """Records of the states after each tick; the first state has no preceding tick."""
    k, n = contents.q.shape
    x, stamps = contents.ended, np.round(1e9 * contents.time).astype(np.int64)
    state, tick = JointStateWriter(contents.joint_names), TickWriter(x.shape[1], n)
    template, starts = bytearray(), list[int]()
    for channel, raw in ((file.states, state.raw), (file.ticks, tick.raw)):
        starts.append(len(template))
        template += MESSAGE.pack(5, 22 + len(raw), channel, 0, 0, 0) + raw
    rows = np.tile(np.frombuffer(bytes(template), np.uint8), (k, 1))
    # Effective commands of the tick that ended at each time.
    command, effort = (np.roll(array, 1, axis=0) for array in (contents.command, efforts))
    effort[0] = 0.0
    notes, measured = (
        np.column_stack([contents.local_error, contents.time_stepped]),
        contents.measured,
    )
    exact = (x[:, :n], x[:, n : 2 * n], effort)
    for start, message, arrays in (
        (starts[0], state, exact if measured is None else _parts(measured)),
        (starts[1], tick, (x, command, notes)),
    ):
        _fill(rows[:, start:], stamps, message, arrays, file.mcap.messages[file.ticks])
    if contents.hold is not None:
        _put(rows, starts[1] + MESSAGE.size + tick.hold, np.roll(contents.hold, 1))
    return _Rows(rows, starts)


def _parts(told: Measured) -> tuple[Array, Array, Array]:
    return told.q, told.v, told.effort


def with_measured(contents: Contents, messages: list[tuple[int, int, bytes]]) -> Contents:
    """A recording with its sensor measurements, if there is a joint state at every time."""
    states = {state.stamp: state for state in (JointStates.read(raw) for *_, raw in messages)}
    found = [states.get(_nanoseconds(time)) for time in contents.time]
    n, rows = len(contents.joint_names), list[Array]()
    for state in found:
        if state is None or any(part.size != n for part in (state.position, state.effort)):
            return contents
        rows.append(np.concatenate([state.position, state.velocity, state.effort]))
    return replace(contents, measured=Measured.of(np.array(rows)))


def _put(rows: NDArray[np.uint8], place: int, values: NDArray[Any]) -> None:
    """Write numbers of shape (k,) or (k, m) into rows of bytes."""
    raw = np.ascontiguousarray(values).view(np.uint8).reshape(len(rows), -1)
    rows[:, place : place + raw.shape[1]] = raw


def _changes(contents: Contents) -> Iterator[tuple[int, Change]]:
    """The start, and every change other than by a tick; the last of several at one time."""
    x = contents.x
    scene, jumps = _scene(contents), {jump.row: i for i, jump in enumerate(contents.jumps)}
    later = [*(jump.tunable for jump in contents.jumps[1:]), tunable_names(scene)]
    tunable = contents.jumps[0].tunable if contents.jumps else tunable_names(scene)
    substep = contents.substep
    changed = np.any(contents.p[1:] != contents.p[:-1], axis=1).nonzero()[0] + 1
    for row in sorted({0, *jumps, *contents.gaps, *changed.tolist()}):
        if row in jumps:
            tunable = later[jumps[row]]
            substep = contents.jumps[jumps[row]].substep
        p, n = contents.p[row], contents.q.shape[1]
        if EXTERNAL not in tunable and EXTERNAL in tunable_names(scene):
            place = _external_place(scene, p)
            p = np.delete(p, np.s_[place - n : place])
        stamp, text = _nanoseconds(contents.time[row]), "changed" if row else "start"
        known = substep if row in jumps or not row else UNCHANGED
        notes = float(contents.local_error[row]), float(contents.time_stepped[row])
        yield row, Change(stamp, text, tunable, p, x[row], (known, *notes))


def _scene(contents: Contents) -> Scene:
    assert contents.origin is not None
    return contents.origin.scene


def tunable_names(scene: Scene) -> tuple[str, ...]:
    """Names of the tunable quantities, in the order of p."""
    names = [name for name in get_args(Tunable) if name in scene.tunable]
    return (*names, *([SWITCHES] if switches(scene.constraints).size else []))


def _external_place(scene: Scene, p: Array) -> int:
    """End of the external torques in p."""
    return len(p) - switches(scene.constraints).size


def read(found: FileContents) -> Contents:
    """A recording from the contents of a file.

    Args:
        found: Changes, ticks and events.

    Raises:
        InvalidInput: If it does not contain a complete recording.
    """
    facts = found.facts[FACTS]
    if facts.get("format") != FORMAT:
        raise InvalidInput(
            f"the recording is of format {facts.get('format')!r}; this version reads {FORMAT}"
        )
    origin = Origin.read(found.texts, facts)
    try:
        names = tuple(map(str, json.loads(facts["joint_names"])))
    except (KeyError, ValueError) as error:
        raise InvalidInput(f"the recording does not name its joints: {error}") from None
    changes = [(place, Change.read(raw)) for place, _, raw in _only(found, CHANGE)]
    ticks = _only(found, TICK)
    if not changes:
        raise InvalidInput("the recording is truncated before its first state")
    return _joined(found, origin, names, changes, ticks)


def left(found: FileContents) -> tuple[str, ...]:
    """Topics of a file that are not of the recording itself, such as commands as received."""
    kinds = dict(found.topics.values())
    states = [topic for topic, kind in kinds.items() if kind == JOINT_STATE][:1]
    own = [topic for topic, kind in kinds.items() if kind in (TICK, CHANGE, LOG, STRING)]
    return found.besides(*states, *own)


def _only(found: FileContents, kind: str) -> list[tuple[int, int, bytes]]:
    return [message for messages in found.of(kind).values() for message in messages]


def _joined(
    found: FileContents, origin: Origin, names: tuple[str, ...], changes: list[tuple[int, Change]],
    ticks: list[tuple[int, int, bytes]],
) -> Contents:  # fmt: skip
    n, nx = len(names), changes[0][1].x.size
    places = np.array([place for place, *_ in ticks], np.int64)
    stamps, x, command, notes, hold = _matrices([raw for *_, raw in ticks], nx, n)
    steps = np.round(1e-9 * stamps / origin.dt).astype(np.int64)
    tunable = changes[-1][1].tunable
    scene = origin.scene.model_copy(
        update={"tunable": tuple(name for name in tunable if name != SWITCHES)}
    )
    run = _Run(origin.dt, scene, n)
    begun = [place for place, _ in changes]
    edges, offsets = np.searchsorted(places, begun).tolist(), list[int]()
    for i, (_, change) in enumerate(changes):
        run.change(change)
        offsets.append(run.offset)
        end = edges[i + 1] if i + 1 < len(edges) else len(ticks)
        block = slice(edges[i], end)
        run.ticks(steps[block], x[block], command[block], notes[block], hold[block])
    events = list(_events(found, begun, origin.dt * np.array(offsets)))
    events += [Event(run.time()[-1], f"file: {damage}") for damage in found.damage]
    return run.contents(replace(origin, scene=scene), names, tuple(events))


def _events(found: FileContents, begun: Sequence[int], offsets: Array) -> Iterator[Event]:
    """Events by the recording's time, which continues across resets.

    Args:
        found: The file.
        begun: Places of the changes in it.
        offsets: The recording's time less simulated time after each of them in [s].
    """
    for place, _, raw in _only(found, LOG):
        stamp, text = log_text(raw)
        yield Event(1e-9 * stamp + float(offsets[max(bisect_right(begun, place) - 1, 0)]), text)


def _matrices(
    raws: list[bytes], nx: int, n: int
) -> tuple[NDArray[np.int64], Array, Array, Array, NDArray[np.uint8]]:
    if not raws:
        none = np.zeros(0, np.int64)
        return none, np.zeros((0, nx)), np.zeros((0, n)), np.zeros((0, 2)), none.astype(np.uint8)
    if tick_sizes(raws[0]) != (nx, n) or len({len(raw) for raw in raws}) > 1:
        raise InvalidInput("the ticks of the recording are not all of the same robot")
    rows = np.frombuffer(b"".join(raws), np.uint8).reshape(len(raws), -1)
    writer = TickWriter(nx, n)
    sizes = zip(writer.places, (nx, n, 2), strict=True)
    x, command, notes = (numbers_at(rows, place, size) for place, size in sizes)
    return stamps_at(rows, writer.stamp), x, command, notes, rows[:, writer.hold].copy()


class _Run:
    """Assembles rows from changes and ticks.

    Attributes:
        offset: Ticks before the last reset: the recording's time less simulated time.
    """

    def __init__(self, dt: float, scene: Scene, n: int) -> None:
        self._dt, self._scene, self._n = dt, scene, n
        self._steps, self._x = list[Any](), list[Array]()
        self._commands, self._notes, self._p = list[Array](), list[Array](), list[Array]()
        self._holds = list[NDArray[np.uint8]]()
        self._jumps, self._gaps = list[Jump](), list[int]()
        self._rows, self.offset, self._last, self._substep = 0, 0, 0, 0.0
        self._tunable: tuple[str, ...] = ()

    def change(self, change: Change) -> None:
        """Apply a change."""
        step, p = round(1e-9 * change.stamp / self._dt), self._whole(change)
        if not self._rows:
            self._row(step, change, np.zeros(self._n), p)
            self._substep = max(change.notes[0], 0.0)
        else:
            self._jump(change, step, p)
        self._tunable, self._present = change.tunable, p

    def _jump(self, change: Change, step: int, p: Array) -> None:
        x, tuned = read_only(self._x[-1][-1]), read_only(self._p[-1][-1])
        if step > self._last:
            self._gaps.append(self._rows)
            self._row(step, change, self._commands[-1][-1], p)
        elif step < self._last:
            self.offset += self._last - step  # a reset: the recording's time continues
        self._last = step
        self._x[-1][-1], self._p[-1][-1] = change.x, p
        if change.notes[0] != UNCHANGED:
            substep = max(change.notes[0], 0.0)
            self._jumps.append(Jump(self._rows - 1, x, tuned, self._tunable, substep))

    def ticks(
        self, steps: NDArray[np.int64], x: Array, command: Array, notes: Array,
        hold: NDArray[np.uint8],
    ) -> None:  # fmt: skip
        """Append successive ticks, and detect missing ones."""
        missing = np.flatnonzero(np.diff(steps, prepend=self._last) != 1).tolist()
        cuts = sorted({0, *missing})
        for first, end in zip(cuts, [*cuts[1:], len(steps)], strict=True):
            if first in missing:
                self._gaps.append(self._rows)
                self.offset += max(0, self._last + 1 - int(steps[first]))
            if first < end:
                block = slice(first, end)
                self._commands[-1][-1], self._holds[-1][-1] = command[first], hold[first]
                self._steps.append(steps[block] + self.offset)
                self._x.append(x[block].copy())
                # The effective command from a time is that of the tick that begins there.
                self._commands.append(np.roll(command[block], -1, axis=0))
                self._holds.append(np.roll(hold[block], -1))
                self._commands[-1][-1], self._holds[-1][-1] = command[end - 1], FREE
                self._notes.append(notes[block])
                self._p.append(np.repeat(self._present[None], end - first, axis=0))
                self._rows, self._last = self._rows + end - first, int(steps[end - 1])

    def _row(self, step: int, change: Change, command: Array, p: Array) -> None:
        self._steps.append(np.array([step + self.offset]))
        self._x.append(change.x[None].copy())
        self._commands.append(command[None].copy())
        self._holds.append(np.array([FREE], np.uint8))
        self._notes.append(np.array([change.notes[1:]]))
        self._p.append(p[None].copy())
        self._rows, self._last = self._rows + 1, step

    def _whole(self, change: Change) -> Array:
        """The vector p with external torques, which may have become tunable later."""
        if EXTERNAL in change.tunable or EXTERNAL not in self._scene.tunable:
            return change.p
        return np.insert(change.p, _external_place(self._scene, change.p), np.zeros(self._n))

    def time(self) -> Array:
        """Time of each row in [s]."""
        return np.asarray(np.concatenate(self._steps) * self._dt)

    def contents(
        self, origin: Origin, names: tuple[str, ...], events: tuple[Event, ...]
    ) -> Contents:
        """The complete recording."""
        n, x, notes = self._n, np.vstack(self._x), np.vstack(self._notes)
        p, hold = read_only(np.vstack(self._p)), np.concatenate(self._holds)
        q, v, z = (read_only(part) for part in np.split(x, (n, 2 * n), axis=1))
        return Contents(
            time=read_only(self.time()), q=q, v=v, z=z,
            command=read_only(np.vstack(self._commands)), local_error=read_only(notes[:, 0]),
            time_stepped=read_only(notes[:, 1]), joint_names=names, p=p, origin=origin,
            held=held_of(self._scene.constraints, p[-1]), jumps=tuple(self._jumps), events=events,
            gaps=tuple(self._gaps), hold=hold if hold.any() else None, substep=self._substep,
        )  # fmt: skip


def _nanoseconds(time: float) -> int:
    return round(1e9 * float(time))
