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
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.scene import Scene
from arm_dynamics.scene.constraint import switches
from arm_dynamics.scene.schema import Tunable
from arm_sim.imperfections import Measured
from arm_sim.plant.placing import held_of
from arm_sim.recording.contents import FREE, Contents, Event, Jump
from arm_sim.recording.files import messages as msg
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, LOG, STRING, TICK
from arm_sim.recording.files.reader import BagContents, BagMessage, read_bag
from arm_sim.recording.files.writer import McapWriter, Place
from arm_sim.recording.origin import URDF_FILE, Origin

FACTS, FORMAT = "arm_sim", "1"
EXTERNAL, SWITCHES = "external", "constraints"
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
        stamp, text = round(1e9 * contents.time[row]), "changed" if row else "start"
        known = substep if row in jumps or not row else UNCHANGED
        yield row, msg.written(
            CHANGE, stamp=stamp, text=text, tunable=tunable, parameters=p, state=x[row],
            substep=known, error=contents.local_error[row],
            time_stepped=contents.time_stepped[row],
        )  # fmt: skip


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
    ticks = _only(found, TICK)
    n, nx = len(names), changes[0][1].state.size
    places = np.array([place for place, *_ in ticks], np.int64)
    rows = msg.tick_layout(nx, n).read([raw for *_, raw in ticks])
    seconds = rows["stamp"][:, 0] + 1e-9 * rows["stamp"][:, 1]
    steps = np.round(seconds / origin.dt).astype(np.int64)
    tunable = changes[-1][1].tunable
    scene = origin.scene.model_copy(
        update={"tunable": tuple(name for name in tunable if name != SWITCHES)}
    )
    run = _Run(origin.dt, scene, n, changes[0][1])
    edges = np.searchsorted(places, [place for place, _ in changes]).tolist()
    for i, (place, change) in enumerate(changes):
        if i:
            run.change(place, change)
        end = edges[i + 1] if i + 1 < len(edges) else len(ticks)
        block = slice(edges[i], end)
        run.ticks(places[block], steps[block], rows[block])
    events = list(_events(found, run, origin.dt))
    made = run.contents(replace(origin, scene=scene), names)
    if scene.sensors is not None:
        made = replace(made, measured=_measured(path, made, run, origin.dt))
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


def _events(found: BagContents, run: _Run, dt: float) -> Iterator[Event]:
    """Events by the recording's time, which continues across resets."""
    for place, _, raw in _only(found, LOG):
        log = msg.read(LOG, raw)
        yield Event(1e-9 * log.stamp + dt * run.offset_at(place), log.msg)


def _measured(path: Path, made: Contents, run: _Run, dt: float) -> Measured | None:
    """Measurements at each time, NaN where the file has none; None if it has none at all."""
    n, found = len(made.joint_names), dict[int, Array]()
    states = read_bag(path, lambda name, kind: kind == JOINT_STATE).of(JOINT_STATE)
    for place, _, raw in next(iter(states.values()), []):
        state = msg.read(JOINT_STATE, raw)
        if state.position.size == state.effort.size == n:
            step = round(1e-9 * state.stamp / dt) + run.offset_at(place)
            row = np.concatenate([state.position, state.velocity, state.effort])
            found.setdefault(step, row)  # the first is that of the tick, before a change
    unknown = np.full(3 * n, np.nan)
    rows = [found.get(step, unknown) for step in np.rint(made.time / dt).astype(int).tolist()]
    return None if np.isnan(rows).all() else Measured.of(np.array(rows))


class _Run:
    """Assembles rows from changes and ticks.

    Attributes:
        offset: Ticks before the last reset: the recording's time less simulated time.
        resets: Places in the file, and the offset from each of them on.
    """

    def __init__(self, dt: float, scene: Scene, n: int, first: Any) -> None:
        self._dt, self._scene, self._n = dt, scene, n
        self._substep, self._tunable = max(first.substep, 0.0), first.tunable
        self._present = self._whole(first)
        self._kind = np.dtype([
            ("step", np.int64), ("state", float, (first.state.size,)), ("command", float, (n,)),
            ("error", float), ("time_stepped", float), ("hold", np.uint8),
            ("p", float, self._present.shape),
        ])  # fmt: skip
        self._blocks = list[NDArray[np.void]]()
        self._jumps, self._gaps = list[Jump](), list[int]()
        self._rows, self.offset, self._last = 0, 0, 0
        self.resets = [(0, 0)]
        self._append([self._step(first)], first)

    def _append(self, steps: Any, message: Any, **more: Any) -> None:
        """Append rows with the state and the notes of a change, or of ticks."""
        block = np.zeros(len(steps), self._kind)
        block["state"], block["error"] = message.state, message.error
        block["time_stepped"], block["p"] = message.time_stepped, self._present
        for name, values in more.items():
            block[name] = values
        block["step"] = np.asarray(steps) + self.offset
        self._blocks.append(block)
        self._rows, self._last = self._rows + len(block), int(steps[-1])

    def _step(self, change: Any) -> int:
        return round(1e-9 * int(change.stamp) / self._dt)

    def _reset(self, place: int, ticks: int) -> None:
        self.offset += ticks
        self.resets.append((place, self.offset))

    def offset_at(self, place: int) -> int:
        """The offset at a place in the file."""
        return self.resets[bisect_right(self.resets, (place, self.offset)) - 1][1]

    def change(self, place: int, change: Any) -> None:
        """Apply a later change."""
        step, before = self._step(change), self._blocks[-1][-1].copy()
        self._present = self._whole(change)
        if step > self._last:
            self._gaps.append(self._rows)
            self._append([step], change, command=before["command"])
        elif step < self._last:
            self._reset(place, self._last - step)  # the recording's time continues
        self._last, now = step, self._blocks[-1][-1]
        now["state"], now["p"] = change.state, self._present
        if change.substep != UNCHANGED:
            x, p = (read_only(before[part].copy()) for part in ("state", "p"))
            substep = max(change.substep, 0.0)
            self._jumps.append(Jump(self._rows - 1, x, p, self._tunable, substep))
        self._tunable = change.tunable

    def ticks(
        self, places: NDArray[np.int64], steps: NDArray[np.int64], rows: NDArray[np.void]
    ) -> None:
        """Append successive ticks, and detect missing ones."""
        missing = np.flatnonzero(np.diff(steps, prepend=self._last) != 1).tolist()
        cuts = sorted({0, *missing})
        for first, end in zip(cuts, [*cuts[1:], len(steps)], strict=True):
            if first in missing:
                self._gaps.append(self._rows)
                self._reset(int(places[first]), max(0, self._last + 1 - int(steps[first])))
            if first < end:
                part, now = rows[first:end].view(np.recarray), self._blocks[-1][-1]
                now["command"], now["hold"] = part["command"][0], part["hold"][0]
                # The effective command from a time is that of the tick that begins there.
                later = np.append(np.arange(first + 1, end), end - 1)
                self._append(
                    steps[first:end], part, command=rows["command"][later],
                    hold=np.append(part["hold"][1:], FREE),
                )  # fmt: skip

    def _whole(self, change: Any) -> Array:
        """The vector p with external torques, which may have become tunable later."""
        p: Array = change.parameters
        if EXTERNAL in change.tunable or EXTERNAL not in self._scene.tunable:
            return p
        return np.insert(p, _external_place(self._scene, p), np.zeros(self._n))

    def contents(self, origin: Origin, names: tuple[str, ...]) -> Contents:
        """The complete recording."""
        n, rows = self._n, np.concatenate(self._blocks)
        q, v, z = np.split(rows["state"], (n, 2 * n), axis=1)
        arrays = {
            "time": rows["step"] * self._dt, "q": q, "v": v, "z": z, "command": rows["command"],
            "local_error": rows["error"], "time_stepped": rows["time_stepped"], "p": rows["p"],
        }  # fmt: skip
        kept: dict[str, Any] = {name: read_only(np.array(x)) for name, x in arrays.items()}
        return Contents(
            **kept, joint_names=names, origin=origin, jumps=tuple(self._jumps),
            held=held_of(self._scene.constraints, rows["p"][-1]), gaps=tuple(self._gaps),
            hold=rows["hold"].copy() if rows["hold"].any() else None, substep=self._substep,
        )  # fmt: skip


def _nanoseconds(time: Array) -> NDArray[np.int64]:
    return np.round(1e9 * time).astype(np.int64)
