# SPDX-License-Identifier: Apache-2.0
"""Signals that end a command: Ctrl-C, SIGTERM and SIGHUP."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from typing import Any

_INTERRUPTIONS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def interruptible() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the program as Ctrl-C does, so that it cleans up.

    SIGINT too, since shells ignore it for background processes.
    """

    def interrupt(number: int, _: Any) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    with handled_by(interrupt):
        yield


@contextmanager
def postponed() -> Iterator[None]:
    """Defer signals to the end of the block; in other threads than the main one, none arrive.

    While rclpy creates a message, an interruption would raise a RuntimeError instead.
    """
    if current_thread() is not main_thread():
        yield
        return
    received: list[int] = []
    with handled_by(lambda number, _: received.append(number)):
        yield
    for number in received:
        signal.raise_signal(number)


@contextmanager
def handled_by(handler: Callable[[int, Any], object] | signal.Handlers) -> Iterator[None]:
    """Handle signals in another way during the block."""
    before = {number: signal.signal(number, handler) for number in _INTERRUPTIONS}
    try:
        yield
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)
