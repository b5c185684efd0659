# SPDX-License-Identifier: Apache-2.0
"""Reads recordings from the ticks and changes of an MCAP file."""

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.scene import Scene
from arm_sim.imperfections import Measured
from arm_sim.plant.admissible_states import active_names
from arm_sim.plant.parameters import CONSTRAINTS, EXTERNAL, insert_external
from arm_sim.recording.contents import FREE, Contents, Event, Jump
from arm_sim.recording.files import messages as msg
from arm_sim.recording.files import tick_writer
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, LOG, STRING, TICK
from arm_sim.recording.files.reader import BagContents, BagMessage, read_bag
from arm_sim.recording.files.tick_writer import FORMAT, UNCHANGED
from arm_sim.recording.files.timeline import Timeline
from arm_sim.recording.origin import Origin


def read(bag: BagContents, path: Path) -> Contents:
    """A recording from the contents of a file.

    Args:
        bag: Changes, ticks and events.
        path: The file, whose joint states are measurements if the scene has sensors.

    Raises:
        InvalidInput: If it does not contain a complete recording.
    """
    metadata = bag.metadata[tick_writer.METADATA]
    if metadata.get("format") != FORMAT:
        raise InvalidInput(
            f"the recording is of format {metadata.get('format')!r}; this version reads {FORMAT}"
        )
    origin = Origin.read(bag.attachments, metadata)
    try:
        names = tuple(map(str, json.loads(metadata["joint_names"])))
    except (KeyError, ValueError) as error:
        raise InvalidInput(f"the recording does not name its joints: {error}") from None
    if not (changes := _messages(bag, CHANGE)):
        raise InvalidInput("the recording is truncated before its first state")
    last = msg.read(CHANGE, changes[-1].data)
    tunable = tuple(name for name in last.tunable if name != CONSTRAINTS)
    scene = origin.scene.model_copy(update={"tunable": tunable})
    ticks = [tick for tick in _messages(bag, TICK) if tick.place > changes[0].place]
    contents, timeline = _motion(replace(origin, scene=scene), names, changes, ticks)
    if scene.sensors is not None:
        contents = replace(contents, measured=_measured(path, contents, timeline))
    events = list[Event]()
    for message in _messages(bag, LOG):
        log = msg.read(LOG, message.data)
        time = 1e-9 * log.stamp + origin.dt * timeline.offset_at(message.place)
        events.append(Event(time, log.msg))
    events += [Event(contents.time[-1], f"file: {damage}") for damage in bag.damage]
    return replace(contents, events=tuple(events))


def other_topics(bag: BagContents) -> tuple[str, ...]:
    """Topics of a file that are not of the recording itself, such as commands as received."""
    kinds = bag.topics.items()
    states = [topic for topic, kind in kinds if kind == JOINT_STATE][:1]
    own = [topic for topic, kind in kinds if kind in (TICK, CHANGE, LOG, STRING)]
    return bag.besides(*states, *own)


def _messages(bag: BagContents, kind: str) -> list[BagMessage]:
    return [message for messages in bag.of(kind).values() for message in messages]


def _motion(
    origin: Origin, names: tuple[str, ...], changes: Sequence[BagMessage],
    ticks: Sequence[BagMessage],
) -> tuple[Contents, Timeline]:  # fmt: skip
    """A recording from its changes and ticks."""
    scene, n = origin.scene, len(names)
    states = [msg.read(CHANGE, change.data) for change in changes]
    rows = msg.tick_layout(states[0].state.size, n).read([tick.data for tick in ticks])
    seconds = rows["stamp"][:, 0] + 1e-9 * rows["stamp"][:, 1]
    stamps = np.concatenate([[1e-9 * change.stamp for change in states], seconds])
    places = np.array([message.place for message in (*changes, *ticks)])
    timeline = Timeline(places, np.round(stamps / origin.dt).astype(np.int64), len(states))

    # Of a tick and the changes after it, which share a row, the last one has the row's state, and
    # the first one the errors; its command and hold are those of the tick that follows.
    p = np.array([_complete(change, scene, n) for change in states])
    last_change = np.cumsum(~timeline.is_tick)[timeline.last] - 1
    x = np.concatenate([[change.state for change in states], rows["state"]])[timeline.order]
    q, v, z = np.split(x[timeline.last], (n, 2 * n), axis=1)
    error, time_stepped = (
        np.append([getattr(change, name) for change in states], rows[name])[timeline.order]
        for name in ("error", "time_stepped")
    )
    number, ticking = timeline.following_ticks()  # 0: none so far, hence the rows in front
    command = np.vstack([np.zeros(n), rows["command"]])[number]
    hold = np.append(np.uint8(FREE), rows["hold"])[number] * ticking
    arrays = {
        "time": timeline.step[timeline.first] * origin.dt, "q": q, "v": v, "z": z,
        "command": command, "local_error": error[timeline.first],
        "time_stepped": time_stepped[timeline.first], "p": p[last_change],
    }  # fmt: skip
    columns: dict[str, Any] = {name: read_only(np.array(x)) for name, x in arrays.items()}
    contents = Contents(
        **columns, joint_names=names, origin=origin, jumps=_jumps(states, p, x, timeline),
        held=active_names(scene.constraints, columns["p"][-1]), hold=hold if hold.any() else None,
        gaps=timeline.gaps, substep=max(states[0].substep, 0.0),
    )  # fmt: skip
    return contents, timeline


def _complete(change: Any, scene: Scene, n: int) -> Array:
    """The vector p of a change with external torques, which may have become tunable later."""
    p: Array = change.parameters
    if EXTERNAL in change.tunable or EXTERNAL not in scene.tunable:
        return p
    return insert_external(p, scene, n)


def _jumps(states: Sequence[Any], p: Array, x: Array, timeline: Timeline) -> tuple[Jump, ...]:
    """Changes of more than external torques; p of each change, x in the order of the file."""
    jumps, places = list[Jump](), np.flatnonzero(~timeline.is_tick)[1:].tolist()
    for place, p_before, (before, change) in zip(places, p[:-1], pairwise(states), strict=True):
        if change.substep != UNCHANGED:
            row, x_before = int(timeline.row[place]), read_only(x[place - 1].copy())
            substep = max(change.substep, 0.0)
            jumps.append(Jump(row, x_before, read_only(p_before), before.tunable, substep))
    return tuple(jumps)


def _measured(path: Path, motion: Contents, timeline: Timeline) -> Measured | None:
    """Measurements at each time, NaN where the file has none; None if it has none at all."""
    assert motion.origin is not None
    n, dt, row_of_step = len(motion.joint_names), motion.origin.dt, dict[int, Array]()
    states = read_bag(path, lambda name, kind: kind == JOINT_STATE).of(JOINT_STATE)
    for message in next(iter(states.values()), []):
        state = msg.read_joint_state(message.data)
        if state.position.size == state.effort.size == n:
            step = round(1e-9 * state.stamp / dt) + timeline.offset_at(message.place)
            row = np.concatenate([state.position, state.velocity, state.effort])
            row_of_step.setdefault(step, row)  # the first is that of the tick, before a change
    unknown, steps = np.full(3 * n, np.nan), np.rint(motion.time / dt).astype(int).tolist()
    rows = [row_of_step.get(step, unknown) for step in steps]
    return None if np.isnan(rows).all() else Measured.of(np.array(rows))
