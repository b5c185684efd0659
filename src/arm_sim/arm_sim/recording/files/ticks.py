# SPDX-License-Identifier: Apache-2.0
"""Recordings as MCAP: ticks and changes, from which a run can be repeated bit by bit."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.scene import Scene
from arm_dynamics.scene.constraint import switches
from arm_dynamics.scene.schema import Tunable
from arm_sim.imperfections import Measured
from arm_sim.plant.parameters import EXTERNAL
from arm_sim.plant.placing import held_of
from arm_sim.recording.contents import FREE, Contents, Event, Jump
from arm_sim.recording.files import messages as msg
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, LOG, STRING, TICK
from arm_sim.recording.files.reader import BagContents, BagMessage, read_bag
from arm_sim.recording.files.writer import McapWriter, Place
from arm_sim.recording.origin import URDF_FILE, Origin

FACTS, FORMAT = "arm_sim", "1"
SWITCHES = "constraints"
UNCHANGED = -1.0
"""Sub-step of a change of external torques only."""
_INFO = 20
_ROWS = 500  # ticks per chunk


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
        seen = np.ones(len(stamps), bool)
        if contents.measured is not None:
            seen = ~np.isnan(contents.measured.q).any(axis=1)
        for row, stamp in enumerate(stamps.tolist()):
            if row and row not in contents.gaps:  # no tick leads across a gap
                if seen[row]:
                    self.add(self.states, stamp, states[row])
                self.add(self.ticks, stamp, ticks[row])
            if row in changes:
                self.add(self.changes, stamp, changes[row])
            if row == 0 and first and seen[row]:
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
    told = contents.measured or Measured(x[:, :n], x[:, n : 2 * n], effort)
    states = msg.joint_state_layout(contents.joint_names).written(
        stamps, position=told.q, velocity=told.v, effort=told.effort
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
    tunable = [*(jump.tunable for jump in contents.jumps), tunable_names(scene)]  # until each
    changed = np.any(contents.p[1:] != contents.p[:-1], axis=1).nonzero()[0] + 1
    passed = 0
    for row in sorted({0, *jumps, *contents.gaps, *changed.tolist()}):
        substep = UNCHANGED if row else contents.substep
        if row in jumps:
            passed = jumps[row]
            substep = contents.jumps[passed - 1].substep
        p = contents.p[row]
        if EXTERNAL not in tunable[passed] and EXTERNAL in tunable[-1]:
            place = _external_place(scene, p)
            p = np.delete(p, np.s_[place - n : place])
        yield row, msg.written(
            CHANGE, stamp=round(1e9 * contents.time[row]), text="changed" if row else "start",
            tunable=tunable[passed], parameters=p, state=x[row], substep=substep,
            error=contents.local_error[row], time_stepped=contents.time_stepped[row],
        )  # fmt: skip


def tunable_names(scene: Scene) -> tuple[str, ...]:
    """Names of the tunable quantities, in the order of p."""
    names = [name for name in get_args(Tunable) if name in scene.tunable]
    return (*names, *([SWITCHES] if switches(scene.constraints).size else []))


def _external_place(scene: Scene, p: Array) -> int:
    """End of the external torques in p."""
    return len(p) - switches(scene.constraints).size


def read(found: BagContents, path: Path) -> Contents:
    """A recording from the contents of a file.

    Args:
        found: Changes, ticks and events.
        path: The file, whose joint states are measurements if the scene has sensors.

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
    changes = [(place, msg.read(CHANGE, raw)) for place, _, raw in _only(found, CHANGE)]
    if not changes:
        raise InvalidInput("the recording is truncated before its first state")
    tunable = tuple(name for name in changes[-1][1].tunable if name != SWITCHES)
    origin = replace(origin, scene=origin.scene.model_copy(update={"tunable": tunable}))
    ticks = [tick for tick in _only(found, TICK) if tick[0] > changes[0][0]]
    made, offset_at = _joined(origin, names, changes, ticks)
    if origin.scene.sensors is not None:
        made = replace(made, measured=_measured(path, made, offset_at))
    events = list[Event]()
    for place, _, raw in _only(found, LOG):
        log = msg.read(LOG, raw)
        events.append(Event(1e-9 * log.stamp + origin.dt * offset_at(place), log.msg))
    events += [Event(made.time[-1], f"file: {damage}") for damage in found.damage]
    return replace(made, events=tuple(events))


def left(found: BagContents) -> tuple[str, ...]:
    """Topics of a file that are not of the recording itself, such as commands as received."""
    kinds = found.topics.items()
    states = [topic for topic, kind in kinds if kind == JOINT_STATE][:1]
    own = [topic for topic, kind in kinds if kind in (TICK, CHANGE, LOG, STRING)]
    return found.besides(*states, *own)


def _only(found: BagContents, kind: str) -> list[BagMessage]:
    return [message for messages in found.of(kind).values() for message in messages]


def _joined(
    origin: Origin, names: tuple[str, ...], changes: Sequence[tuple[int, Any]],
    ticks: Sequence[BagMessage],
) -> tuple[Contents, Callable[[int], int]]:  # fmt: skip
    """A recording from its changes and ticks, in a time that continues across resets.

    Returns:
        The recording, and a function: by how many ticks its time is ahead of the simulation's at a
        place in the file.
    """
    scene, n = origin.scene, len(names)
    change_places, states = zip(*changes, strict=True)
    places = np.array([*change_places, *(place for place, *_ in ticks)])
    order = np.argsort(places)
    rows = msg.tick_layout(states[0].state.size, n).read([raw for *_, raw in ticks])
    seconds = rows["stamp"][:, 0] + 1e-9 * rows["stamp"][:, 1]
    stamps = np.concatenate([[1e-9 * change.stamp for change in states], seconds])
    places = places[order]
    own, ticked = np.round(stamps / origin.dt).astype(np.int64)[order], order >= len(states)
    # A tick ends one step after what precedes it, and a change is at the same time. A change that
    # is earlier is a reset; everything else is a gap. Ticks and changes after gaps begin a row.
    ahead = np.diff(own, prepend=own[0])
    steps = own[0] + np.cumsum(np.maximum(ahead, ticked))
    begins = ticked | (ahead > 0)
    begins[0] = True
    row, first = np.cumsum(begins) - 1, np.flatnonzero(begins)
    last = np.append(first[1:], len(order)) - 1

    p = np.array([_complete(change, scene, n) for change in states])
    x = np.concatenate([[change.state for change in states], rows["state"]])[order]
    q, v, z = np.split(x[last], (n, 2 * n), axis=1)
    error, time_stepped = (
        np.append([getattr(change, name) for change in states], rows[name])[order][first]
        for name in ("error", "time_stepped")
    )
    # The effective command from a time is that of the tick that begins there, else of the last.
    following = np.append(first[1:], len(order) - 1)
    acting = np.cumsum(ticked)[following]
    command = np.vstack([np.zeros(n), rows["command"]])[acting]
    hold = np.append(np.uint8(FREE), rows["hold"])[acting] * np.append(ticked[first[1:]], False)
    arrays = {
        "time": steps[first] * origin.dt, "q": q, "v": v, "z": z, "command": command,
        "local_error": error, "time_stepped": time_stepped, "p": p[np.cumsum(~ticked)[last] - 1],
    }  # fmt: skip
    kept: dict[str, Any] = {name: read_only(np.array(array)) for name, array in arrays.items()}
    jumps = [
        Jump(int(row[at]), read_only(x[at - 1].copy()), read_only(before), earlier.tunable,
             max(change.substep, 0.0))
        for at, before, (earlier, change) in zip(
            np.flatnonzero(~ticked)[1:], p[:-1], pairwise(states), strict=True
        )
        if change.substep != UNCHANGED
    ]  # fmt: skip

    def offset_at(place: int) -> int:
        at = max(int(np.searchsorted(places, place, side="right")) - 1, 0)
        return int(steps[at] - own[at])

    made = Contents(
        **kept, joint_names=names, origin=origin, jumps=tuple(jumps),
        held=held_of(scene.constraints, kept["p"][-1]), hold=hold if hold.any() else None,
        gaps=tuple(row[begins & (ahead != ticked)].tolist()), substep=max(states[0].substep, 0.0),
    )  # fmt: skip
    return made, offset_at


def _complete(change: Any, scene: Scene, n: int) -> Array:
    """The vector p of a change with external torques, which may have become tunable later."""
    p: Array = change.parameters
    if EXTERNAL in change.tunable or EXTERNAL not in scene.tunable:
        return p
    return np.insert(p, _external_place(scene, p), np.zeros(n))


def _measured(path: Path, made: Contents, offset_at: Callable[[int], int]) -> Measured | None:
    """Measurements at each time, NaN where the file has none; None if it has none at all."""
    assert made.origin is not None
    n, dt, found = len(made.joint_names), made.origin.dt, dict[int, Array]()
    states = read_bag(path, lambda name, kind: kind == JOINT_STATE).of(JOINT_STATE)
    for place, _, raw in next(iter(states.values()), []):
        state = msg.read(JOINT_STATE, raw)
        if state.position.size == state.effort.size == n:
            step = round(1e-9 * state.stamp / dt) + offset_at(place)
            row = np.concatenate([state.position, state.velocity, state.effort])
            found.setdefault(step, row)  # the first is that of the tick, before a change
    unknown = np.full(3 * n, np.nan)
    rows = [found.get(step, unknown) for step in np.rint(made.time / dt).astype(int).tolist()]
    return None if np.isnan(rows).all() else Measured.of(np.array(rows))


def _nanoseconds(time: Array) -> NDArray[np.int64]:
    return np.round(1e9 * time).astype(np.int64)
