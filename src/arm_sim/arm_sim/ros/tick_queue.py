# SPDX-License-Identifier: Apache-2.0
"""Actions of other threads that the ticking thread runs between two ticks."""

from collections.abc import Callable
from concurrent.futures import Future, wait
from ctypes import c_int64
from queue import SimpleQueue
from typing import Any

from arm_dynamics import InvalidInput


class TickQueue:
    """A queue of actions; while no thread serves it, an action runs immediately.

    A caller waits for up to ``timeout`` in [s]. Both sides delete a future when it is done: its
    exception refers to their frames, which would be a cycle, freed only much later.

    Attributes:
        is_served: Whether another thread empties the queue.
        bell: Nonzero while the ticking thread has work between two ticks.
    """

    def __init__(self, timeout: float = 30.0) -> None:
        self.is_served, self.bell = False, c_int64()
        self._timeout = timeout
        self._queue: SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = SimpleQueue()

    def run(self, action: Callable[[], Any]) -> Any:
        """Run an action between two ticks; return its result, or raise its exception.

        Raises:
            InvalidInput: If it was not done in time: it is discarded, unless it has begun.
        """
        if not self.is_served:
            return action()
        future: Future[Any] = Future()
        self._queue.put((action, future))
        self.ring()
        try:
            wait([future], self._timeout)
            if future.cancel():
                raise InvalidInput(f"the simulation did not respond in {self._timeout:g} s")
            if not future.done():
                raise InvalidInput(f"after {self._timeout:g} s it is still being done")
            return future.result()
        finally:
            del future

    def post(self, action: Callable[[], Any]) -> None:
        """Run an action between two ticks, without waiting; it must not raise."""
        if self.is_served:
            self._queue.put((action, Future()))
            self.ring()
        else:
            action()

    def ring(self) -> None:
        """Let C ask for the queue to be run."""
        self.bell.value = 1

    def serve(self) -> None:
        """Run the queued actions."""
        self.bell.value = 0
        while not self._queue.empty():
            action, future = self._queue.get()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(action())
            except Exception as error:
                future.set_exception(error)
                del action, future
