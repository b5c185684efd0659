# SPDX-License-Identifier: Apache-2.0
"""Reports of the progress of long runs, and of the drawing of their films."""

import logging
import sys
from threading import current_thread, main_thread
from time import perf_counter
from typing import Self

DELAY = 2.0  # [s] before the first report
REDRAW_PERIOD = 0.2  # [s] on a terminal

_log = logging.getLogger(__name__)


class Progress:
    """Reports how much of a motion is simulated or drawn, if that takes long.

    On a terminal and in a notebook it is a line on stderr that is overwritten and finally erased.
    Where messages of level INFO are logged, it is one of them after 2, 4, 8 … seconds instead; a
    level above WARNING silences both.

    Args:
        total: Duration of the motion in [s].
        activity: What is done with it, as "simulated".
    """

    def __init__(self, total: float, activity: str = "simulated") -> None:
        self._total, self._activity, self._begin = total, activity, perf_counter()
        self._due, self._line_length = self._begin + DELAY, 0

    def update(self, time: float) -> None:
        """Report, if it is due, that it has come to a time of the motion in [s]."""
        if (now := perf_counter()) < self._due:
            return
        elapsed = now - self._begin
        remaining = (self._total - time) * elapsed / time if time else float("inf")
        text = (
            f"{time:.6g} of {self._total:.6g} s {self._activity}, {time / elapsed:.3g} times real "
            f"time, {remaining:.0f} s left"
        )
        if _log.isEnabledFor(logging.INFO):
            self._due = now + elapsed
            _log.info("%s", text)
        else:
            self._due = now + REDRAW_PERIOD
            interactive = sys.stderr.isatty() or "ipykernel" in sys.modules
            is_main = current_thread() is main_thread()  # no other writes there
            if interactive and is_main and _log.isEnabledFor(logging.WARNING):
                print(f"\r{text:{self._line_length}}", end="", file=sys.stderr, flush=True)
                self._line_length = len(text)

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(self, *_: object) -> None:
        """Erase the line."""
        if self._line_length:
            print(f"\r{'':{self._line_length}}\r", end="", file=sys.stderr, flush=True)
