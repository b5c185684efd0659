# SPDX-License-Identifier: Apache-2.0
"""Buffering of messages for a file that a background thread writes.

Adding a message never waits for the disk. It is copied into a chunk (``native/record.c``); the
thread writes whole chunks by the library ``mcap``, which takes some 10 µs for a message. The
number of chunks is fixed: when the disk is too slow, messages are dropped and counted. A message
that is larger than a chunk gets one of its own.
"""

import errno
import os
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue

from arm_sim.recording.files import McapWriter
from arm_sim.ros.record.chunk import HEAD, PERIOD, Chunk

SIZE = 1 << 20  # bytes per chunk
COUNT = 8  # number of chunks
_FULL = {errno.ENOSPC: "the disk is full", errno.EDQUOT: "the disk quota is used up"}
_NICE = 10  # priority of the thread, below those with deadlines


class ChunkThread:
    """Writes messages to a file, which it closes; ``on_failure`` gets the message of a failure.

    Attributes:
        lock: Held while ``chunk`` and ``room`` are used.
        chunk: The one that is being filled.
        lost: Number of messages that are not in the file.
        trouble: What keeps them from it.
        written: Number of bytes in the file.
        processor_time: What the thread has used in [s].
        failure: Reason why writing has stopped; empty while it has not.
    """

    def __init__(
        self, mcap: McapWriter, on_failure: Callable[[str], None] = lambda text: None
    ) -> None:
        self.mcap, self._on_failure = mcap, on_failure
        self.lost, self.trouble, self.failure = 0, "the disk is slow", ""
        self._closed = False
        self._free_chunks, self._full_chunks = SimpleQueue[Chunk](), SimpleQueue[Chunk | None]()
        for _ in range(COUNT - 1):
            self._free_chunks.put(Chunk(SIZE))
        self.chunk, self.lock, self._writing = Chunk(SIZE), threading.RLock(), threading.Lock()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self.written, self.processor_time = 0, 0.0
        self._thread.start()

    def add(self, channel: int, log: int, publish: int, data: bytes | bytearray) -> bool:
        """Add a message with its times of arrival and publication in [ns]; from any thread.

        Returns:
            Whether it was stored.
        """
        return self.add_all(log, ((channel, publish, data),))

    def add_all(self, log: int, messages: Sequence[tuple[int, int, bytes | bytearray]]) -> bool:
        """Add related messages: channel, publish time and data of each."""
        size = sum([HEAD + len(data) for _, _, data in messages])
        with self.lock:
            chunk = self.room(log, size, len(messages))
            if chunk is None:
                return False
            for channel, publish, data in messages:
                chunk.put(channel, log, publish, data)
            return True

    def room(self, log: int, size: int, count: int, patience: float = 0.0) -> Chunk | None:
        """A chunk with room for messages that arrive now, or None if they are lost.

        The lock must be held. ``size`` in bytes includes ``HEAD`` for each of ``count`` messages;
        ``patience`` is the time in [s] to wait for the disk.
        """
        if self._closed:
            return None
        if not self.chunk.fits(log, size) and not self._exchange(size, patience):
            self.lost += count
            return None
        return self.chunk

    def channel(self, topic: str, kind: str, definition: str, profile: str = "") -> int:
        """Add a channel while others are being written; see ``McapWriter.channel``."""
        with self._writing:
            return self.mcap.channel(topic, kind, definition, profile)

    def _exchange(self, size: int = 0, patience: float = 0.0) -> bool:
        """Pass the current chunk to the thread, and begin one for so many bytes if one is free."""
        if self.failure:
            self.lost += self.chunk.count
            self.chunk.clear()
            return False
        try:
            free = self._free_chunks.get(timeout=patience)
        except Empty:
            return False
        self._full_chunks.put(self.chunk)
        self.chunk = free if size <= free.size else Chunk(size)
        return True

    def end(self) -> None:
        """Take no more messages."""
        with self.lock:
            if self._closed:
                return
            self._closed = True
            self._full_chunks.put(self.chunk)
            self._full_chunks.put(None)
            self.chunk = Chunk(HEAD)

    def close(self) -> None:
        """Write all messages and the summary, and end the thread; may be called repeatedly."""
        if not self._closed:  # else ticks in progress may hold the lock for long
            self.end()
        self._thread.join()

    def _run(self) -> None:
        """Write full chunks until recording ends; while there are none, what waits in others."""
        with suppress(OSError, AttributeError):  # optional: ignored if not permitted
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        while True:
            try:
                chunk = self._full_chunks.get(timeout=PERIOD)
            except Empty:
                self._write_idle()
                continue
            if chunk is None:
                break
            self._write(chunk)
            self.processor_time = time.thread_time()
            self._free_chunks.put(chunk if chunk.size == SIZE else Chunk(SIZE))
        self._end()

    def _write_idle(self) -> None:
        """Write the last messages even if no further ones arrive."""
        if not self.lock.acquire(blocking=False):
            return  # wakes up when messages arrive
        try:
            if not self.chunk.fits(time.time_ns(), 0):
                self._exchange()
        finally:
            self.lock.release()

    def _write(self, chunk: Chunk) -> None:
        """Write a chunk; after a failure its messages are lost."""
        if not self.failure:
            try:
                with self._writing:
                    for message in chunk.messages():
                        self.mcap.add_message(*message)
                    self.mcap.flush()
                self.written = self.mcap.file.tell()
            except Exception as error:  # otherwise the thread would end silently
                self._fail(error, chunk.count)
        else:
            self._lose(chunk.count)
        chunk.clear()

    def _lose(self, count: int) -> None:
        with self.lock:
            self.lost += count

    def _fail(self, error: Exception, lost: int) -> None:
        """Note that the recording has stopped, and tell why."""
        self._lose(lost)
        why = str(error) if isinstance(error, OSError) else repr(error)
        full = _FULL.get(getattr(error, "errno", None) or 0)
        self.trouble = full or "the recording has stopped"
        self.failure = (
            f"recording stopped after {self.written} bytes, which remain readable: "
            f"{f'{full} ({why})' if full else why}"
        )
        self._on_failure(self.failure)

    def _end(self) -> None:
        try:
            if self.failure:  # what is in the file stays as it is
                self.mcap.file.close()
            else:
                self.mcap.close()
        except OSError as error:
            if not self.failure:
                self._fail(error, 0)
