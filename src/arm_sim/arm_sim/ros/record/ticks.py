# SPDX-License-Identifier: Apache-2.0
"""Records every tick of a simulation, and what came in between."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.cdr import TIME
from arm_dynamics.exceptions import InvalidInput
from arm_sim.recording.files import TickFile, bag_metadata, where
from arm_sim.recording.files.messages import Change, TickWriter, log_message
from arm_sim.recording.files.ticks import UNCHANGED, tunable_names
from arm_sim.ros.record.chunks import ChunkThread
from arm_sim.ros.tick_engine import TickEngine

INFO, ERROR = 20, 40
_MANY = 100  # messages between two ticks


class TickRecorder:
    """Writes what an engine does to a file; used by the ticking thread, but for what says else.

    Attributes:
        ticks: How many are in the file or on their way.
        lost: How many are not, since the disk could not follow.
        path: The file or folder.
        thread: What writes.
    """

    def __init__(
        self,
        path: Path,
        engine: TickEngine,
        prefix: str = "/sim",
        states: str = "/joint_states",
        topics: Mapping[str, tuple[str, str]] = MappingProxyType({}),
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Begin a file and follow the engine.

        Args:
            path: ``.mcap``, or a bag's folder.
            engine: What is recorded.
            prefix: Of our topics.
            states: Topic of the joint states.
            topics: Of messages that ``message`` is going to bring: type and definition.
            tell: Called with what went wrong, by another thread.

        Raises:
            InvalidInput: If the path means neither, or is there already.
            OSError: If it cannot be written.
        """
        self._simulator = simulator = engine.simulator
        self._engine, self.path = engine, path
        if path.exists():
            raise InvalidInput(f"'{path}' exists; a recording takes no other one's place")
        self._name, (self._file, self._folder) = prefix.rpartition("/")[2], where(path)
        self.file = TickFile(self._file, simulator.origin, simulator.joint_names, prefix, states)
        begin = self.file.mcap.channel
        self._channels = {topic: begin(topic, *about) for topic, about in topics.items()}
        self._channels[states] = self.file.states
        self.thread = ChunkThread(self.file.mcap, tell)
        self._writer = TickWriter(simulator.plant.nx, simulator.n)
        self._x = memoryview(simulator.x).cast("B")
        self._acted = memoryview(simulator.acted).cast("B")
        self._notes = memoryview(simulator.notes).cast("B")
        self._published: tuple[int, int, bytearray] | None = None
        self._waiting = deque[tuple[int, int, bytes]]()
        self._whole = True  # whether the file has every tick up to the last
        self._plant, self._p = simulator.plant, b""
        self.ticks = self.lost = 0
        channel, robot = self.file.robot()
        self.thread.add(channel, time.time_ns(), 0, robot)
        self._begin("start")
        engine.on_tick.append(self.tick)
        engine.on_idle.append(self._flush)
        engine.on_jump.append(lambda: self._begin("changed"))
        engine.on_failure.append(lambda: self.note(engine.failure, ERROR))
        engine.on_staleness.append(self._staleness)
        engine.on_pause.append(lambda: self.note("paused" if engine.paused else "goes on"))

    def tick(self) -> None:
        """Take the tick that was just made."""
        now, simulator, writer = time.time_ns(), self._simulator, self._writer
        if not self._whole:
            self.lost += 1
            self._begin("gap")
            return
        if simulator.plant is not self._plant or (
            self._p and simulator.parameters.tobytes() != self._p
        ):
            self._tuned()
        stamp, raw = self._engine.stamp, writer.raw
        TIME.pack_into(raw, writer.stamp, *divmod(stamp, 1_000_000_000))
        writer.state[:], writer.command[:], writer.notes[:] = self._x, self._acted, self._notes
        raw[writer.hold] = simulator.hold
        messages = self._taken(now)
        messages.append((self.file.ticks, stamp, raw))
        if self.thread.add_all(now, messages):
            self.ticks += 1
        else:
            self.lost += 1
            self._whole = False

    def published(self, stamp: int, message: bytearray) -> None:
        """Take a joint state with its stamp in [ns], whose bytes stay until the next one."""
        self._published = self.file.states, stamp, message

    def message(self, topic: str, stamp: int, data: bytes) -> None:
        """Take another message, with its stamp in [ns], 0: of the present; for any thread.

        It goes to the file with the next tick: a loop does not lock and look at the clock twice.
        """
        self._waiting.append((self._channels[topic], stamp, data))
        if len(self._waiting) > _MANY:  # nothing ticks
            self._flush()

    def _taken(self, now: int) -> list[tuple[int, int, bytes | bytearray]]:
        """What came since the last tick, and the joint state that was published last."""
        found: list[tuple[int, int, bytes | bytearray]] = []
        waiting = self._waiting
        while waiting:
            channel, stamp, data = waiting.popleft()
            found.append((channel, stamp or now, data))
        if self._published is not None:
            found.append(self._published)
            self._published = None
        return found

    def _flush(self) -> None:
        """Write what no tick follows: at a change, or while time stands still."""
        now = time.time_ns()
        if messages := self._taken(now):
            self.thread.add_all(now, messages)

    def note(self, text: str, level: int = INFO) -> None:
        """Note an event; any thread may call it."""
        stamp, now = self._engine.stamp, time.time_ns()
        self.thread.add(self.file.log, now, stamp, log_message(stamp, level, self._name, text))

    def _staleness(self) -> None:
        stale, policy = self._engine.commands.stale, self._engine.stale_policy
        self.note(f"no command: the policy '{policy}' acts" if stale else "commands are back")

    def _tuned(self) -> None:
        """Note what was tuned since the last tick, of which the file has the state after it."""
        simulator, x = self._simulator, np.frombuffer(self._writer.state)
        fresh = simulator.plant is not self._plant
        stamp = round(1e9 * ((simulator.step_count - 1) * simulator.dt))
        self._change(stamp, "tuned", x, 0.0 if fresh else UNCHANGED)

    def _begin(self, why: str) -> None:
        """Write what is from here on."""
        simulator = self._simulator
        self._flush()
        self._writer.state[:] = self._x
        self._whole = self._change(self._engine.stamp, why, simulator.x, simulator.substep)

    def _change(self, stamp: int, why: str, x: Array, substep: float) -> bool:
        simulator = self._simulator
        self._plant, p = simulator.plant, simulator.parameters
        tunable, self._p = tunable_names(self._plant.model.scene), p.tobytes()
        error, stepped = simulator.notes.tolist()
        change = Change(stamp, why, tunable, p, x, (substep, error, stepped))
        return self.thread.add(self.file.changes, time.time_ns(), stamp, change.written())

    def report(self) -> dict[str, Any]:
        """How it went: ticks, what was lost, bytes, and the thread's processor time in [s]."""
        thread = self.thread
        return {
            "ticks": self.ticks, "lost": self.lost, "messages lost": thread.lost,
            "written": thread.mcap.written, "processor time": thread.processor_time,
            "failure": thread.failure,
        }  # fmt: skip

    def close(self) -> None:
        """Write what there is, and end."""
        self._flush()
        self.thread.close()
        if self._folder is not None and not self.thread.failure:
            text = bag_metadata(self.file.mcap, self._file.name)
            (self._folder / "metadata.yaml").write_text(text)
