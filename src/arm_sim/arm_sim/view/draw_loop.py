# SPDX-License-Identifier: Apache-2.0
"""The thread that animates a page, and runs its requests."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from arm_dynamics.exceptions import ArmError

RATE = 60.0  # [Hz] at which pictures change at most

_log = logging.getLogger(__name__)


class DrawLoop:
    """Calls ``beat`` at most sixty times a second, and the page's requests between two calls.

    So only one thread changes the content of a page.

    Args:
        beat: Called with the time in [s] since the last call.
        on_error: Called with the error message of a refused request.
    """

    def __init__(self, beat: Callable[[float], None], on_error: Callable[[str], None]) -> None:
        self._beat, self._on_error = beat, on_error
        self._orders: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="arm view", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def order(self, action: Callable[[], object]) -> None:
        """Run a function before the next beat; for any thread."""
        self._orders.put(action)

    def moved(self, action: Callable[[Any], object]) -> Callable[[Any], None]:
        """A callback for a control: user input is a request, values set by the program are not.

        Args:
            action: Takes the control's value.
        """

        def callback(event: Any) -> None:
            if event.client is not None:
                self.order(lambda: action(event.target.value))

        return callback

    def stop(self) -> None:
        """End the thread, and wait until it has ended."""
        self._ended.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=5.0)

    def wait(self, seconds: float | None = None) -> None:
        """Wait for the end."""
        self._ended.wait(seconds)

    def _run(self) -> None:
        last = time.monotonic()
        while not self._ended.is_set():
            now = time.monotonic()
            self._guarded(self._serve)
            self._guarded(partial(self._beat, now - last))
            last = now
            self._ended.wait(max(0.0, now + 1.0 / RATE - time.monotonic()))

    def _serve(self) -> None:
        while not self._orders.empty():
            self._guarded(self._orders.get())

    def _guarded(self, action: Callable[[], object]) -> None:
        try:
            action()
        except ArmError as error:
            self._on_error(str(error))
        except Exception as error:  # otherwise the page would stop without a message
            _log.exception("the view met a failure")
            self._on_error(f"{type(error).__name__}: {error}")
