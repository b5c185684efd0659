# SPDX-License-Identifier: Apache-2.0
"""Log messages: of the cores, for a terminal or a node, and those that may be repeated."""

import logging
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

CORES = ("arm_dynamics", "arm_sim")
PERIOD = 1.0  # [s] between messages with the same reason
MOST_REASONS = 10  # messages in that time, whatever their reasons
_NUMBERS = re.compile(r"(?<!\w)[-+]?\d[\d.]*(?:e[-+]?\d+)?")  # not in names
_handlers: list[logging.Handler] = []


@contextmanager
def heard_by(handler: logging.Handler) -> Iterator[None]:
    """Pass log messages of the cores from level INFO to a handler within the context.

    Only the innermost handler receives them.
    """
    loggers = [logging.getLogger(name) for name in CORES]
    levels = [logger.level for logger in loggers]
    _handlers.append(handler)
    for logger in loggers:
        for outer in _handlers[-2:-1]:
            logger.removeHandler(outer)
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        _handlers.remove(handler)
        for logger, level in zip(loggers, levels, strict=True):
            logger.removeHandler(handler)
            for outer in _handlers[-1:]:
                logger.addHandler(outer)
            logger.setLevel(level)


class Throttled:
    """A logger for messages that may come a thousand times a second.

    A reason is logged once in a period, and at most ``MOST_REASONS`` reasons are, by the steady
    clock: a system clock that is set back silences nothing. While one is repeated in every period,
    only the first message says what is allowed.

    Args:
        log: A node's logger; it needs a line of code for each severity.
        clock: Returns the time in [s].
        period: Length of a period in [s].
    """

    def __init__(
        self, log: Any, clock: Callable[[], float] = time.monotonic, period: float = PERIOD
    ) -> None:
        self._log, self._clock, self._period = log, clock, period
        self._times: dict[str, float] = {}
        self._latest = "", 0.0

    def info(self, text: str, reason: str | None = None) -> None:
        """Log, unless the reason, by default the text without its numbers, is known by now."""
        if due := self._due(text, reason):
            self._log.info(due)

    def warning(self, text: str, reason: str | None = None) -> None:
        """Log as a warning; see ``info``."""
        if due := self._due(text, reason):
            self._log.warning(due)

    def error(self, text: str, reason: str | None = None) -> bool:
        """Log as an error, see ``info``; return whether it was logged."""
        if due := self._due(text, reason):
            self._log.error(due)
        return bool(due)

    def _due(self, text: str, reason: str | None) -> str:
        """What is to be logged now, empty if nothing."""
        now, why = self._clock(), _NUMBERS.sub("#", text) if reason is None else reason
        recent = {why: at for why, at in tuple(self._times.items()) if now - at < self._period}
        if why in recent or len(recent) >= MOST_REASONS:
            return ""
        self._times = recent | {why: now}
        before, at = self._latest
        self._latest = why, now
        is_stream = why == before and now - at < 2.0 * self._period
        return text.partition("; allowed: ")[0] if is_stream else text
