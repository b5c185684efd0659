# SPDX-License-Identifier: Apache-2.0
"""Messages on their way to a file: gathered by those who have them, written by a thread.

Who hands over a message never waits for the disk. It is copied into a chunk as it will be in the
file; the thread compresses whole chunks and writes them, almost all of it without the interpreter
lock. There are a few chunks, and no more: when the disk cannot follow, messages are lost and
counted.
"""

from __future__ import annotations

import os
import threading
import time
from array import array
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue

import numpy as np

from arm_sim.recording.files import MESSAGE, McapWriter

PERIOD = 0.5  # [s] after which a chunk goes to the file, full or not
SIZE = 1 << 20  # bytes of a chunk
COUNT = 8  # chunks there are
_OPCODE, _EXTRA = 5, 22  # of a message, and what its length counts besides its data
_HEAD, _pack = MESSAGE.size, MESSAGE.pack_into
_PERIOD_NS = round(1e9 * PERIOD)
_NICE = 10  # priority of the thread: below those that keep deadlines


class _Chunk:
    """Room for messages."""

    def __init__(self) -> None:
        self.raw = bytearray(SIZE)
        self.at, self.since = 0, 0
        self.places = array("q")

    def clear(self) -> None:
        """Empty it."""
        self.at, self.since = 0, 0
        self.places = array("q")


class ChunkThread:
    """Writes messages to a file.

    Args:
        mcap: The file, whose channels have been begun; closed at the end.
        tell: Called with what went wrong, once, by the thread.

    Attributes:
        lost: How many messages were lost because the disk could not follow, or refused.
        failure: Why nothing is written any more; empty while it is.
    """

    def __init__(self, mcap: McapWriter, tell: Callable[[str], None] = lambda text: None) -> None:
        self.mcap, self._tell = mcap, tell
        self.lost, self.failure, self._closed = 0, "", False
        self._free, self._full = SimpleQueue[_Chunk](), SimpleQueue[_Chunk | None]()
        for _ in range(COUNT - 1):
            self._free.put(_Chunk())
        self._chunk, self._lock, self._writing = _Chunk(), threading.Lock(), threading.Lock()
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
        size = 0
        for _, _, data in messages:
            size += _HEAD + len(data)
        with self._lock:
            chunk = self._chunk
            at = chunk.at
            if at + size > SIZE or (at and log - chunk.since > _PERIOD_NS):
                if self._closed or size > SIZE or not self._exchange():
                    self.lost += len(messages)
                    return False
                chunk, at = self._chunk, 0
            if not at:
                if self._closed:
                    return False
                chunk.since = log
            raw, note = chunk.raw, chunk.places.append
            for channel, publish, data in messages:
                start = at + _HEAD
                end = start + len(data)
                _pack(raw, at, _OPCODE, end - start + _EXTRA, channel, 0, log, publish)
                raw[start:end] = data
                note(at)
                at = end
            chunk.at = at
            return True

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
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self._full.put(self._chunk)
            self._full.put(None)
            self._chunk = _Chunk()
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
        with self._lock:
            chunk = self._chunk
            if chunk.at and time.time_ns() - chunk.since > _PERIOD_NS:
                self._exchange()

    def _write(self, chunk: _Chunk) -> None:
        if not self.failure:
            try:
                with memoryview(chunk.raw)[: chunk.at] as data, self._writing:
                    self.mcap.chunk(data, np.array(chunk.places, np.int64))
            except Exception as error:  # else the thread would end without a word
                self._fail(error, len(chunk.places))
        else:
            self.lost += len(chunk.places)
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
