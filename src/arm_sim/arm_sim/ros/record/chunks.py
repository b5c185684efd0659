# SPDX-License-Identifier: Apache-2.0
"""Messages on their way to a file: gathered by those who have them, written by a thread.

Who hands over a message never waits for the disk. It is copied into a chunk as it will be in the
file, by Python or, where it comes with every tick, by C (``native/record.c``); the thread
compresses whole chunks and writes them, almost all of it without the interpreter lock. There are a
few chunks, and no more: when the disk cannot follow, messages are lost and counted.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import Structure, addressof, c_char, c_int64, c_void_p
from queue import Empty, SimpleQueue

import numpy as np
from numpy.typing import NDArray

from arm_sim.recording.files import MESSAGE, McapWriter

PERIOD = 0.5  # [s] after which a chunk goes to the file, full or not
SIZE = 1 << 20  # bytes of a chunk
COUNT = 8  # chunks there are
_OPCODE, _EXTRA = 5, 22  # of a message, and what its length counts besides its data
HEAD, _pack = MESSAGE.size, MESSAGE.pack_into
PERIOD_NS = round(1e9 * PERIOD)
_NICE = 10  # priority of the thread: below those that keep deadlines


class Chunk(Structure):
    """Room for messages: ``chunk_t`` of record.c.

    Attributes:
        at: Bytes so far.
        count: Messages so far.
        since: Time of the first of them in [ns].
    """

    _fields_ = (
        ("raw", c_void_p), ("places", c_void_p),
        ("at", c_int64), ("count", c_int64), ("since", c_int64),
    )  # fmt: skip

    def __init__(self) -> None:
        """Make room for ``SIZE`` bytes, and as many messages as these may be."""
        self._memory, self._starts = bytearray(SIZE), np.zeros(SIZE // HEAD, np.int64)
        raw = addressof(c_char.from_buffer(self._memory))
        super().__init__(raw=raw, places=self._starts.ctypes.data)
        self.address = c_void_p(addressof(self))

    def put(self, channel: int, log: int, publish: int, data: bytes | bytearray) -> None:
        """Copy a message, for which there is room; as ``put_record`` of record.c."""
        at, size = self.at, len(data)
        if not at:
            self.since = log
        _pack(self._memory, at, _OPCODE, size + _EXTRA, channel, 0, log, publish)
        self._memory[at + HEAD : at + HEAD + size] = data
        self._starts[self.count] = at
        self.count, self.at = self.count + 1, at + HEAD + size

    @property
    def data(self) -> bytes:
        """What is in it."""
        return bytes(memoryview(self._memory)[: self.at])

    @property
    def starts(self) -> NDArray[np.int64]:
        """Where in it each message begins."""
        return self._starts[: self.count].copy()

    def clear(self) -> None:
        """Empty it."""
        self.at = self.count = self.since = 0


class ChunkThread:
    """Writes messages to a file.

    Args:
        mcap: The file, whose channels have been begun; closed at the end.
        tell: Called with what went wrong, once, by the thread.

    Attributes:
        lock: Held by who uses ``room``.
        lost: How many messages were lost because the disk could not follow, or refused.
        failure: Why nothing is written any more; empty while it is.
    """

    def __init__(self, mcap: McapWriter, tell: Callable[[str], None] = lambda text: None) -> None:
        self.mcap, self._tell = mcap, tell
        self.lost, self.failure, self._closed = 0, "", False
        self._free, self._full = SimpleQueue[Chunk](), SimpleQueue[Chunk | None]()
        for _ in range(COUNT - 1):
            self._free.put(Chunk())
        self._chunk, self.lock, self._writing = Chunk(), threading.RLock(), threading.Lock()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self.processor_time = 0.0
        self._thread.start()

    def add(self, channel: int, log: int, publish: int, data: bytes | bytearray) -> bool:
        """Hand over a message; any thread may.

        Args:
            channel: Its number in the file.
            log: Time it came at in [ns].
            publish: Time it bears in [ns].
            data: Its bytes, copied at once.

        Returns:
            Whether there was room for it.
        """
        return self.add_all(log, ((channel, publish, data),))

    def add_all(self, log: int, messages: Sequence[tuple[int, int, bytes | bytearray]]) -> bool:
        """Hand over messages that belong together: channel, publish time and data of each."""
        size = sum([HEAD + len(data) for _, _, data in messages])
        with self.lock:
            chunk = self.room(log, size, len(messages))
            if chunk is None:
                return False
            for channel, publish, data in messages:
                chunk.put(channel, log, publish, data)
            return True

    def room(self, log: int, size: int, count: int) -> Chunk | None:
        """A chunk with room for messages that come now; for who holds the lock.

        Args:
            log: The time in [ns].
            size: Their bytes, with ``HEAD`` for each.
            count: How many they are.

        Returns:
            The chunk, or None if they are lost.
        """
        if self._closed:
            return None
        chunk = self._chunk
        at = chunk.at
        if (at + size > SIZE or (at and log - chunk.since > PERIOD_NS)) and (
            size > SIZE or not self._exchange()
        ):
            self.lost += count
            return None
        return self._chunk

    def channel(self, topic: str, kind: str, definition: str, profile: str = "") -> int:
        """Begin a channel while others are being written; see ``McapWriter.channel``."""
        with self._writing:
            return self.mcap.channel(topic, kind, definition, profile)

    def _exchange(self) -> bool:
        """Hand the present chunk to the thread and begin another, if there is one."""
        if self.failure:
            self._chunk.clear()
            return False
        try:
            free = self._free.get_nowait()
        except Empty:
            return False
        self._full.put(self._chunk)
        self._chunk = free
        return True

    def close(self) -> None:
        """Write what there is and the summary, and end the thread; a second call does nothing."""
        with self.lock:
            if self._closed:
                return
            self._closed = True
            self._full.put(self._chunk)
            self._full.put(None)
            self._chunk = Chunk()
        self._thread.join()

    def _run(self) -> None:
        with suppress(OSError, AttributeError):  # what cannot be had is not needed
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        while True:
            try:
                chunk = self._full.get(timeout=PERIOD)
            except Empty:
                self._look_after_the_last()
                continue
            if chunk is None:
                break
            self._write(chunk)
            self.processor_time = time.thread_time()
            self._free.put(chunk)
        self._end()

    def _look_after_the_last(self) -> None:
        """Where nothing comes any more, what came last is written all the same."""
        if not self.lock.acquire(blocking=False):
            return  # then something comes
        try:
            chunk = self._chunk
            if chunk.at and time.time_ns() - chunk.since > PERIOD_NS:
                self._exchange()
        finally:
            self.lock.release()

    def _write(self, chunk: Chunk) -> None:
        if not self.failure:
            try:
                with self._writing:
                    self.mcap.chunk(chunk.data, chunk.starts)
            except Exception as error:  # else the thread would end without a word
                self._fail(error, chunk.count)
        else:
            self.lost += chunk.count
        chunk.clear()

    def _fail(self, error: Exception, lost: int) -> None:
        self.lost += lost
        why = error if isinstance(error, OSError) else repr(error)
        self.failure = (
            f"recording stopped after {self.mcap.written} bytes, what was written stays "
            f"readable: {why}"
        )
        self._tell(self.failure)

    def _end(self) -> None:
        try:
            self.mcap.close()
        except OSError as error:
            if not self.failure:
                self._fail(error, 0)
