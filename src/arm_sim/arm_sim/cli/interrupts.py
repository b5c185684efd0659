# SPDX-License-Identifier: Apache-2.0
"""Signals that end a command: Ctrl-C, SIGTERM and SIGHUP."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from typing import Any

from arm_dynamics.starting import SIGNALS, end_when_interrupted

NODES = ("sim", "dynamics", "controller")
# Signals that have interrupted a command
interrupted: list[int] = []
_original_handlers: dict[int, Any] = {}
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


def begin() -> None:
    """End this program if it is interrupted during its imports: as click does later, nodes with 0.

    A node handles signals itself as soon as it runs, and ends in the same way until then.
    """
    if sys.argv[1:2] and sys.argv[1] in NODES:
        end_when_interrupted()
        return
    _original_handlers.update({number: signal.getsignal(number) for number in SIGNALS})
    end_when_interrupted(1, "\nAborted!\n")


def handle_in_command() -> None:
    """From now on, interruptions are handled by the command."""
    for number, handler in _original_handlers.items():
        is_default = handler is signal.default_int_handler
        signal.signal(number, _interrupt if is_default else handler)
    _original_handlers.clear()


def _interrupt(number: int, frame: Any) -> None:
    """Raise KeyboardInterrupt and note it: an import of compiled code raises something else."""
    interrupted.append(number)
    raise KeyboardInterrupt


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
