# SPDX-License-Identifier: Apache-2.0
"""Recordings as MCAP: ticks and changes, from which a run can be repeated bit by bit."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.scene import Scene
from arm_sim.imperfections import Measured
from arm_sim.plant.parameters import (
    CONSTRAINTS,
    EXTERNAL,
    names_of,
    with_external,
    without_external,
)
from arm_sim.plant.placing import held_of
from arm_sim.recording.contents import FREE, Contents, Event, Jump
from arm_sim.recording.files import messages as msg
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, LOG, STRING, TICK
from arm_sim.recording.files.reader import BagContents, BagMessage, read_bag
from arm_sim.recording.files.writer import McapWriter, Place
from arm_sim.recording.origin import URDF_FILE, Origin

FACTS, FORMAT = "arm_sim", "1"
UNCHANGED = -1.0
"""Sub-step of a change of external torques only."""
_INFO = 20
_ROWS = 500  # ticks per chunk
Indices = NDArray[np.int64]


class TickFile(McapWriter):
    """A file of ticks that is being written.

    Args:
        place: As for ``McapWriter``.
        origin: Scene and method.
        joint_names: Order of the joints.
        prefix: Prefix of the suite's topics, such as ``/sim``.
        states: Topic of joint states.

    Attributes:
        states: Number of the channel of joint states.
        ticks: Number of that of ticks.
        changes: Number of that of changes.
        log: Number of that of events.
        robot: Number of that of the robot's description.
        urdf: The message on it.
    """

    def __init__(
        self,
        place: Place,
        origin: Origin,
        joint_names: Sequence[str],
        prefix: str = "/sim",
        states: str = "/joint_states",
    ) -> None:
        super().__init__(place)
        facts = {"format": FORMAT, "joint_names": json.dumps(list(joint_names)), **origin.about()}
        self.add_metadata(FACTS, facts)
        texts = origin.texts()
        for name, text in texts.items():
            self.add_attachment(0, 0, name, "text/plain", text.encode())
        folder = states.rpartition("/")[0]
        self.states, self.ticks, self.changes, self.log, self.robot = (
            self.channel(topic, kind, msg.definition(kind), msg.LATCHED if kind == STRING else "")
            for topic, kind in (
                (states, JOINT_STATE), (f"{prefix}/ticks", TICK), (f"{prefix}/changes", CHANGE),
                (f"{prefix}/events", LOG), (f"{folder}/robot_description", STRING),
            )
        )  # fmt: skip
        self.urdf = msg.written(STRING, data=texts[URDF_FILE])

    def add(self, channel: int, stamp: int, message: bytes) -> None:
        """Add a message of a time in [ns]."""
        self.add_message(channel, stamp, message, stamp)

    def write(self, contents: Contents, efforts: Array, first: bool = False) -> None:
        """Write a recording.

        Args:
            contents: The recording.
            efforts: Torques on the joints from each time, shape (k+1, n).
            first: Whether it is the first one, and does not begin where the last one ends.
        """
        changes, stamps = dict(_changes(contents)), _nanoseconds(contents.time)
        if not first and not any(jump.row == 0 for jump in contents.jumps):
            del changes[0]  # the state there is that in which the last one ends
        states, ticks = _messages(contents, efforts, stamps)
        measured = np.ones(len(stamps), bool)
        if contents.measured is not None:
            measured = ~np.isnan(contents.measured.q).any(axis=1)
        for row, stamp in enumerate(stamps.tolist()):
            if row and row not in contents.gaps:  # no tick leads across a gap
                if measured[row]:
                    self.add(self.states, stamp, states[row])
                self.add(self.ticks, stamp, ticks[row])
            if row in changes:
                self.add(self.changes, stamp, changes[row])
            if row == 0 and first and measured[row]:
                self.add(self.states, stamp, states[row])
            if row % _ROWS == 0:
                self.flush()  # type: ignore[no-untyped-call]
        self.flush()  # type: ignore[no-untyped-call]


def write(place: Place, contents: Contents, efforts: Array) -> TickFile:
    """Write a recording; return the open file, to be closed by the caller, or written on.

    Raises:
        InvalidInput: If it is not of a simulated scene.
        OSError: If it cannot be written.
    """
    if contents.origin is None:
        raise InvalidInput("the recording is not of a simulated scene")
    file = TickFile(place, contents.origin, contents.joint_names)
    file.add(file.robot, int(_nanoseconds(contents.time[:1])[0]), file.urdf)
    for event in contents.events:
        stamp = round(1e9 * event.time)
        file.add(file.log, stamp, log_message(stamp, _INFO, "sim", event.text))
    file.write(contents, efforts, first=True)
    return file


def log_message(stamp: int, level: int, name: str, text: str) -> bytes:
    """An event as a message."""
    return msg.written(LOG, stamp=stamp, level=level, name=name, msg=text)


def _messages(
    contents: Contents, efforts: Array, stamps: NDArray[np.int64]
) -> tuple[list[bytes], list[bytes]]:
    """Joint state and tick of every time; the first state has no preceding tick."""
    n, x = contents.q.shape[1], contents.ended
    # Effective commands of the tick that ended at each time.
    command, effort = (np.roll(array, 1, axis=0) for array in (contents.command, efforts))
    effort[0] = 0.0
    joints = contents.measured or Measured(x[:, :n], x[:, n : 2 * n], effort)
    states = msg.joint_state_layout(contents.joint_names).written(
        stamps, position=joints.q, velocity=joints.v, effort=joints.effort
    )
    ticks = msg.tick_layout(x.shape[1], n).written(
        stamps, state=x, command=command, error=contents.local_error,
        time_stepped=contents.time_stepped,
        hold=FREE if contents.hold is None else np.roll(contents.hold, 1),
    )  # fmt: skip
    return states, ticks


def _changes(contents: Contents) -> Iterator[tuple[int, bytes]]:
    """The start, and every change other than by a tick; the last of several at one time."""
    assert contents.origin is not None
    x, scene, n = contents.x, contents.origin.scene, contents.q.shape[1]
    jumps = {jump.row: i for i, jump in enumerate(contents.jumps, 1)}
    tunable = [*(jump.tunable for jump in contents.jumps), names_of(scene)]  # until each
    changed = np.any(contents.p[1:] != contents.p[:-1], axis=1).nonzero()[0] + 1
    passed = 0
    for row in sorted({0, *jumps, *contents.gaps, *changed.tolist()}):
        substep = UNCHANGED if row else contents.substep
        if row in jumps:
            passed = jumps[row]
            substep = contents.jumps[passed - 1].substep
        p = contents.p[row]
        if EXTERNAL not in tunable[passed] and EXTERNAL in tunable[-1]:
            p = without_external(p, scene, n)
        yield row, msg.written(
            CHANGE, stamp=round(1e9 * contents.time[row]), text="changed" if row else "start",
            tunable=tunable[passed], parameters=p, state=x[row], substep=substep,
            error=contents.local_error[row], time_stepped=contents.time_stepped[row],
        )  # fmt: skip


def read(bag: BagContents, path: Path) -> Contents:
    """A recording from the contents of a file.

    Args:
        bag: Changes, ticks and events.
        path: The file, whose joint states are measurements if the scene has sensors.

    Raises:
        InvalidInput: If it does not contain a complete recording.
    """
    facts = bag.facts[FACTS]
    if facts.get("format") != FORMAT:
        raise InvalidInput(
            f"the recording is of format {facts.get('format')!r}; this version reads {FORMAT}"
        )
    origin = Origin.read(bag.texts, facts)
    try:
        names = tuple(map(str, json.loads(facts["joint_names"])))
    except (KeyError, ValueError) as error:
        raise InvalidInput(f"the recording does not name its joints: {error}") from None
    changes = _only(bag, CHANGE)
    if not changes:
        raise InvalidInput("the recording is truncated before its first state")
    tunable = msg.read(CHANGE, changes[-1].data).tunable
    scene = origin.scene.model_copy(
        update={"tunable": tuple(name for name in tunable if name != CONSTRAINTS)}
    )
    ticks = [tick for tick in _only(bag, TICK) if tick.place > changes[0].place]
    contents, timeline = _joined(replace(origin, scene=scene), names, changes, ticks)
    if scene.sensors is not None:
        contents = replace(contents, measured=_measured(path, contents, timeline))
    events = list[Event]()
    for message in _only(bag, LOG):
        log = msg.read(LOG, message.data)
        events.append(
            Event(1e-9 * log.stamp + origin.dt * timeline.offset_at(message.place), log.msg)
        )
    events += [Event(contents.time[-1], f"file: {damage}") for damage in bag.damage]
    return replace(contents, events=tuple(events))


def left(bag: BagContents) -> tuple[str, ...]:
    """Topics of a file that are not of the recording itself, such as commands as received."""
    kinds = bag.topics.items()
    states = [topic for topic, kind in kinds if kind == JOINT_STATE][:1]
    own = [topic for topic, kind in kinds if kind in (TICK, CHANGE, LOG, STRING)]
    return bag.besides(*states, *own)


def _only(bag: BagContents, kind: str) -> list[BagMessage]:
    return [message for messages in bag.of(kind).values() for message in messages]


class _Timeline:
    """Changes and ticks in the order of their file, in a time that continues across resets.

    A tick ends one step after its predecessor, and a change is at the same time. A change that is
    earlier is a reset; everything else is a gap. Ticks, and changes after gaps, begin a row.

    Args:
        places: Places in the file, of changes, then of ticks.
        steps: Their steps in the simulation's own time.
        changes: Number of changes.

    Attributes:
        order: Indices in order of the file.
        is_tick: Whether each in this order is a tick, or a change.
        step: Step of each in the continuing time.
        row: Row of each.
        first: The first one of each row.
        last: The last one of each row.
        gaps: Rows before which ticks are missing.
    """

    def __init__(self, places: Indices, steps: Indices, changes: int) -> None:
        self.order = np.argsort(places)
        self.is_tick = self.order >= changes
        self._places, self._steps = places[self.order], steps[self.order]
        ahead = np.diff(self._steps, prepend=self._steps[0])
        self.step = self._steps[0] + np.cumsum(np.maximum(ahead, self.is_tick))
        begins = self.is_tick | (ahead > 0)
        begins[0] = True
        self.row, self.first = np.cumsum(begins) - 1, np.flatnonzero(begins)
        self.last = np.append(self.first[1:], len(begins)) - 1
        self.gaps = tuple(self.row[begins & (ahead != self.is_tick)].tolist())

    def offset_at(self, place: int) -> int:
        """Steps by which the continuing time is ahead of the simulation's at a place in a file."""
        at = max(int(np.searchsorted(self._places, place, side="right")) - 1, 0)
        return int(self.step[at] - self._steps[at])


def _joined(
    origin: Origin, names: tuple[str, ...], changes: Sequence[BagMessage],
    ticks: Sequence[BagMessage],
) -> tuple[Contents, _Timeline]:  # fmt: skip
    """A recording from its changes and ticks."""
    scene, n = origin.scene, len(names)
    states = [msg.read(CHANGE, change.data) for change in changes]
    rows = msg.tick_layout(states[0].state.size, n).read([tick.data for tick in ticks])
    seconds = rows["stamp"][:, 0] + 1e-9 * rows["stamp"][:, 1]
    stamps = np.concatenate([[1e-9 * change.stamp for change in states], seconds])
    places = np.array([message.place for message in (*changes, *ticks)])
    timeline = _Timeline(places, np.round(stamps / origin.dt).astype(np.int64), len(states))
    order, is_tick, first, last = timeline.order, timeline.is_tick, timeline.first, timeline.last

    p = np.array([_complete(change, scene, n) for change in states])
    x = np.concatenate([[change.state for change in states], rows["state"]])[order]
    q, v, z = np.split(x[last], (n, 2 * n), axis=1)
    error, time_stepped = (
        np.append([getattr(change, name) for change in states], rows[name])[order][first]
        for name in ("error", "time_stepped")
    )
    # The effective command from a time is that of the tick that begins there, else of the last.
    following = np.append(first[1:], len(order) - 1)
    acting = np.cumsum(is_tick)[following]
    command = np.vstack([np.zeros(n), rows["command"]])[acting]
    hold = np.append(np.uint8(FREE), rows["hold"])[acting] * np.append(is_tick[first[1:]], False)
    arrays = {
        "time": timeline.step[first] * origin.dt, "q": q, "v": v, "z": z, "command": command,
        "local_error": error, "time_stepped": time_stepped, "p": p[np.cumsum(~is_tick)[last] - 1],
    }  # fmt: skip
    columns: dict[str, Any] = {name: read_only(np.array(x)) for name, x in arrays.items()}
    jumps = [
        Jump(int(timeline.row[at]), read_only(x[at - 1].copy()), read_only(before),
             earlier.tunable, max(change.substep, 0.0))
        for at, before, (earlier, change) in zip(
            np.flatnonzero(~is_tick)[1:], p[:-1], pairwise(states), strict=True
        )
        if change.substep != UNCHANGED
    ]  # fmt: skip
    contents = Contents(
        **columns, joint_names=names, origin=origin, jumps=tuple(jumps),
        held=held_of(scene.constraints, columns["p"][-1]), hold=hold if hold.any() else None,
        gaps=timeline.gaps, substep=max(states[0].substep, 0.0),
    )  # fmt: skip
    return contents, timeline


def _complete(change: Any, scene: Scene, n: int) -> Array:
    """The vector p of a change with external torques, which may have become tunable later."""
    p: Array = change.parameters
    if EXTERNAL in change.tunable or EXTERNAL not in scene.tunable:
        return p
    return with_external(p, scene, n)


def _measured(path: Path, motion: Contents, timeline: _Timeline) -> Measured | None:
    """Measurements at each time, NaN where the file has none; None if it has none at all."""
    assert motion.origin is not None
    n, dt, row_of_step = len(motion.joint_names), motion.origin.dt, dict[int, Array]()
    states = read_bag(path, lambda name, kind: kind == JOINT_STATE).of(JOINT_STATE)
    for message in next(iter(states.values()), []):
        state = msg.read(JOINT_STATE, message.data)
        if state.position.size == state.effort.size == n:
            step = round(1e-9 * state.stamp / dt) + timeline.offset_at(message.place)
            row = np.concatenate([state.position, state.velocity, state.effort])
            row_of_step.setdefault(step, row)  # the first is that of the tick, before a change
    unknown, steps = np.full(3 * n, np.nan), np.rint(motion.time / dt).astype(int).tolist()
    rows = [row_of_step.get(step, unknown) for step in steps]
    return None if np.isnan(rows).all() else Measured.of(np.array(rows))


def _nanoseconds(time: Array) -> NDArray[np.int64]:
    return np.round(1e9 * time).astype(np.int64)
