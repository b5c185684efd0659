# SPDX-License-Identifier: Apache-2.0
"""Work that other threads want done by the thread that ticks, between two ticks."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from queue import Empty, SimpleQueue
from typing import Any

from arm_dynamics import InvalidInput

_PATIENCE = 30.0  # [s] that one who asks waits


class Errands:
    """A queue of things to do; with nobody else to do them, they are done at once.

    Attributes:
        served: Whether another thread empties the queue.
    """

    def __init__(self) -> None:
        """Start empty; nobody serves yet."""
        self.served = False
        self._queue: SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = SimpleQueue()

    def run(self, action: Callable[[], Any]) -> Any:
        """Have something done and wait for its result, or for its exception.

        Raises:
            InvalidInput: If nobody did it in time.
        """
        if not self.served:
            return action()
        future: Future[Any] = Future()
        self._queue.put((action, future))
        try:
            return future.result(_PATIENCE)
        except TimeoutError:
            future.cancel()
            raise InvalidInput(f"the simulation gave no answer in {_PATIENCE:g} s") from None

    def serve(self) -> None:
        """Do what is in the queue."""
        while not self._queue.empty():
            try:
                action, future = self._queue.get_nowait()
            except Empty:
                return
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(action())
            except Exception as error:
                future.set_exception(error)
