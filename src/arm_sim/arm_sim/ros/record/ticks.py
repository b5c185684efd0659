# SPDX-License-Identifier: Apache-2.0
"""Records every tick of a simulation, and the messages between ticks."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from ctypes import Structure, addressof
from pathlib import Path
from types import MappingProxyType
from typing import Any

from arm_dynamics.codegen.addresses import address
from arm_sim.recording.files import TickFile, new_file
from arm_sim.recording.files.messages import CHANGE, tick_layout, written
from arm_sim.recording.files.tick_writer import UNCHANGED, log_message
from arm_sim.ros.commands.latest import in_force
from arm_sim.ros.node_library import RECORD
from arm_sim.ros.record.chunk_thread import ChunkThread
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.simulation.simulated_arm import SimulatedArm

INFO, ERROR = 20, 40  # levels of rcl_interfaces/Log
_PARTS = ("state", "command", "error")  # and time_stepped, which follows it
_MANY = 100  # largest number of messages between two ticks


class TickCopy(Structure):
    """``tick_t`` of record.h: where C copies a tick, and from where."""

    _fields_ = RECORD.fields("tick_t")

    def __init__(self, arm: SimulatedArm, tick: int, state: int) -> None:
        """Prepare; ``tick`` and ``state`` are the numbers of their channels."""
        layout, numbers = tick_layout(arm.plant.nx, arm.n), (arm.x, arm.acted, arm.notes)
        self.message, self._numbers = bytearray(layout.raw), numbers
        super().__init__(
            raw=address(self.message), size=len(layout.raw), stamp_at=layout.place("stamp"),
            hold_at=layout.place("hold"), tick_channel=tick, state_channel=state,
        )  # fmt: skip
        for k, (name, array) in enumerate(zip(_PARTS, numbers, strict=True)):
            self.at[k], self.sizes[k] = layout.place(name), array.nbytes
            self.numbers[k] = array.ctypes.data


class TickRecorder:
    """Writes the ticks of an engine to a file; for the ticking thread, unless stated otherwise.

    C copies ticks, the joint states published for them, and the commands that it reads.

    Attributes:
        lost: Number of ticks that are not in the file.
        path: The file or folder.
        channels: Numbers of the topics' channels in the file.
        thread: The writing thread.
    """

    def __init__(
        self, path: Path, engine: TickEngine, prefix: str = "/sim", states: str = "/joint_states",
        topics: Mapping[str, tuple[str, str]] = MappingProxyType({}),
        on_failure: Callable[[str], None] = lambda text: None,
    ) -> None:  # fmt: skip
        """Create the file, ``.mcap`` or a bag's folder, and attach to the engine.

        ``prefix`` is that of the suite's topics, ``topics`` are types and definitions of those
        passed to ``add_message``; another thread calls ``on_failure`` with why writing stopped.

        Raises:
            InvalidInput: If the path has another suffix, or exists already.
            OSError: If it cannot be written.
        """
        self._arm = arm = engine.simulator.arm
        self._engine, self.path = engine, path
        self._name = prefix.rpartition("/")[2]
        self.file = TickFile(new_file(path), arm.origin, arm.joint_names, prefix, states)
        channel = self.file.channel
        self.channels = {topic: channel(topic, *about) for topic, about in topics.items()}
        self.channels[states] = self.file.state_channel
        self.thread = ChunkThread(self.file, on_failure)
        self._copy = TickCopy(arm, self.file.tick_channel, self.file.state_channel)
        self._pending_states = deque[tuple[int, bytes]](maxlen=1)
        self._pending_messages = deque[tuple[int, int, bytes]]()
        # Whether every tick since the last complete state is in the file
        self._is_continuous = True
        self._plant, self._parameters = arm.plant, b""
        self.lost = 0
        self.thread.add(self.file.robot_channel, time.time_ns(), 0, self.file.description)
        self._begin("start")
        ticks = engine.ticks
        ticks.copy, ticks.chunk = addressof(self._copy), None
        ticks.answer(space=self._make_space)
        ticks.before_ticks.append(self._refresh)
        engine.guard = self.thread.lock
        engine.on.idle.append(self._write_idle)
        engine.on.jump.append(lambda: self._begin("changed"))
        engine.on.failure.append(lambda: self.note(engine.failure, ERROR))
        engine.on.staleness.append(self._note_staleness)
        engine.on.pause.append(lambda: self.note("paused" if engine.paused else "continues"))

    @property
    def ticks(self) -> int:
        """Number of ticks in the file or in its buffers."""
        return int(self._engine.ticks.recorded_count)

    def _refresh(self) -> None:
        """Write what comes before the next tick, and let C know where to copy that."""
        arm = self._arm
        has_new_plant = arm.plant is not self._plant
        if has_new_plant or (self._parameters and arm.parameters.tobytes() != self._parameters):
            self._write_change("tuned", 0.0 if has_new_plant else UNCHANGED)
        self._flush()
        self._engine.ticks.chunk = self.thread.chunk.address if self._is_continuous else None

    def _make_space(self) -> bool:
        """Make space for a tick; if the disk is too slow, lose it, and begin again after it."""
        # Steps by request go as fast as possible: to wait for the disk delays nothing else.
        needs, patience = self._engine.ticks.needed_space, 1.0 if self._engine.paused else 0.0
        if self._is_continuous and self.thread.room(time.time_ns(), needs, 1, patience):
            return True
        self.lost += 1
        if self._is_continuous:
            self._is_continuous = False
        else:
            self._begin("gap")
        return False

    def _write_idle(self) -> None:
        """While time stands still, messages are written, too."""
        self._flush()
        with self.thread.lock:
            self.thread.room(time.time_ns(), 0, 0)

    def add_state(self, stamp: int, message: bytearray) -> None:
        """Record a joint state between ticks, with its stamp in [ns]."""
        self._pending_states.append((stamp, bytes(message)))  # other threads write it

    def add_message(self, topic: str, stamp: int, data: bytes) -> None:
        """Record another message, with its stamp in [ns] (0: now); may be called from any thread.

        It is written with the next tick, so the loop locks and reads the clock only once.
        """
        self._pending_messages.append((self.channels[topic], stamp, data))
        if len(self._pending_messages) > _MANY:  # without ticks
            self._flush(wait=False)

    def _flush(self, wait: bool = True) -> None:
        """Write messages that no tick follows: at a change, or while time stands still.

        Without ``wait`` for ticks in progress, they may be written with these.
        """
        if not self.thread.lock.acquire(blocking=wait):
            return
        try:
            now, messages = time.time_ns(), list[tuple[int, int, bytes]]()
            while self._pending_messages:  # others only append
                channel, stamp, data = self._pending_messages.popleft()
                messages.append((channel, stamp or now, data))
            while self._pending_states:
                messages.append((self.file.state_channel, *self._pending_states.popleft()))
            if messages:
                self.thread.add_all(now, messages)
        finally:
            self.thread.lock.release()

    def note(self, text: str, level: int = INFO) -> None:
        """Record an event; may be called from any thread."""
        stamp = self._engine.stamp
        message = log_message(stamp, level, self._name, text)
        self._pending_messages.append((self.file.log_channel, stamp, message))
        self._flush(wait=False)

    def _note_staleness(self) -> None:
        stale, policy = self._engine.commands.stale, self._engine.stale_policy
        self.note(f"no command: {in_force(policy)}" if stale else "commands have resumed")

    def _begin(self, why: str) -> None:
        """Write the complete current state."""
        self._flush()
        self._is_continuous = self._write_change(why, self._arm.substep)

    def _write_change(self, why: str, substep: float) -> bool:
        arm, stamp = self._arm, self._engine.stamp
        self._plant, p = arm.plant, arm.parameters
        tunable, self._parameters = self._plant.parameters.names, p.tobytes()
        error, stepped = arm.notes.tolist()
        change = written(
            CHANGE, stamp=stamp, text=why, tunable=tunable, parameters=p, state=arm.x,
            substep=substep, error=error, time_stepped=stepped,
        )  # fmt: skip
        return self.thread.add(self.file.change_channel, time.time_ns(), stamp, change)

    def report(self) -> dict[str, Any]:
        """Summary: ticks, losses, bytes, and the thread's processor time in [s]."""
        thread = self.thread
        return {
            "ticks": self.ticks, "lost": self.lost, "messages lost": thread.lost,
            "written": thread.written, "processor time": thread.processor_time,
            "failure": thread.failure,
        }  # fmt: skip

    def close(self) -> None:
        """Write the remaining messages, and end; may be called from any thread."""
        self._engine.queue.run(self._end)
        self.thread.close()

    def _end(self) -> None:
        self._flush()
        self.thread.end()
