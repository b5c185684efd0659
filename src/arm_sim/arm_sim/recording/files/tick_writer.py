# SPDX-License-Identifier: Apache-2.0
"""Writes recordings as MCAP: ticks and changes, from which a run is repeated bit by bit."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_sim.imperfections import Measured
from arm_sim.plant.parameters import EXTERNAL, names_of, remove_external
from arm_sim.recording.contents import FREE, Contents
from arm_sim.recording.files import messages as msg
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, LOG, STRING, TICK
from arm_sim.recording.files.writer import McapWriter, Place
from arm_sim.recording.origin import URDF_FILE, Origin

METADATA, FORMAT = "arm_sim", "1"
# Sub-step of a change of external torques only
UNCHANGED = -1.0
_INFO = 20  # level of rcl_interfaces/Log
_ROWS = 500  # ticks per chunk


class TickFile(McapWriter):
    """A file of ticks that is being written.

    Args:
        place: As for ``McapWriter``.
        origin: Scene and method.
        joint_names: Order of the joints.
        prefix: Prefix of the suite's topics, such as ``/sim``.
        states_topic: Topic of joint states.

    Attributes:
        state_channel: Number of the channel of joint states.
        tick_channel: Number of the channel of ticks.
        change_channel: Number of the channel of changes.
        log_channel: Number of the channel of events.
        robot_channel: Number of the channel of the robot description.
        description: The message with the robot description.
    """

    def __init__(
        self, place: Place, origin: Origin, joint_names: Sequence[str], prefix: str = "/sim",
        states_topic: str = "/joint_states",
    ) -> None:  # fmt: skip
        super().__init__(place)
        names = json.dumps(list(joint_names))
        self.add_metadata(METADATA, {"format": FORMAT, "joint_names": names, **origin.about()})
        texts = origin.texts()
        for name, text in texts.items():
            self.add_attachment(0, 0, name, "text/plain", text.encode())
        folder = states_topic.rpartition("/")[0]
        self.state_channel = self._channel(states_topic, JOINT_STATE)
        self.tick_channel = self._channel(f"{prefix}/ticks", TICK)
        self.change_channel = self._channel(f"{prefix}/changes", CHANGE)
        self.log_channel = self._channel(f"{prefix}/events", LOG)
        self.robot_channel = self._channel(f"{folder}/robot_description", STRING, msg.LATCHED)
        self.description = msg.written(STRING, data=texts[URDF_FILE])

    def _channel(self, topic: str, kind: str, profile: str = "") -> int:
        return self.channel(topic, kind, msg.definition(kind), profile)

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
        stamps = _nanoseconds(contents.time)
        changes = dict(_changes(contents, stamps))
        if not first and not any(jump.row == 0 for jump in contents.jumps):
            del changes[0]  # the state there is that in which the last one ends
        states, ticks = _messages(contents, efforts, stamps)
        measured = np.ones(len(stamps), bool)
        if contents.measured is not None:
            measured = ~np.isnan(contents.measured.q).any(axis=1)
        for row, stamp in enumerate(stamps.tolist()):
            if row and row not in contents.gaps:  # no tick leads across a gap
                if measured[row]:
                    self.add(self.state_channel, stamp, states[row])
                self.add(self.tick_channel, stamp, ticks[row])
            if row in changes:
                self.add(self.change_channel, stamp, changes[row])
            if row == 0 and first and measured[row]:
                self.add(self.state_channel, stamp, states[row])
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
    file.add(file.robot_channel, int(_nanoseconds(contents.time[0])), file.description)
    for event in contents.events:
        stamp = int(_nanoseconds(event.time))
        file.add(file.log_channel, stamp, log_message(stamp, _INFO, "sim", event.text))
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


def _changes(contents: Contents, stamps: NDArray[np.int64]) -> Iterator[tuple[int, bytes]]:
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
            p = remove_external(p, scene, n)
        yield row, msg.written(
            CHANGE, stamp=int(stamps[row]), text="changed" if row else "start",
            tunable=tunable[passed], parameters=p, state=x[row], substep=substep,
            error=contents.local_error[row], time_stepped=contents.time_stepped[row],
        )  # fmt: skip


def _nanoseconds(time: Any) -> Any:
    """Times in [ns]."""
    return np.round(1e9 * time).astype(np.int64)
