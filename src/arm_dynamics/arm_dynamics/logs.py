# SPDX-License-Identifier: Apache-2.0
"""Log messages of the cores, for a terminal or a node."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

CORES = ("arm_dynamics", "arm_sim")
_listening: list[logging.Handler] = []


@contextmanager
def heard_by(handler: logging.Handler) -> Iterator[None]:
    """Pass log messages of the cores from level INFO to a handler within the context.

    Only the innermost handler receives them.
    """
    loggers = [logging.getLogger(name) for name in CORES]
    levels = [logger.level for logger in loggers]
    _listening.append(handler)
    for logger in loggers:
        _hand_over(logger, _listening[-2:-1], [handler])
        logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        _listening.remove(handler)
        for logger, level in zip(loggers, levels, strict=True):
            _hand_over(logger, [handler], _listening[-1:])
            logger.setLevel(level)


def _hand_over(
    logger: logging.Logger, before: list[logging.Handler], after: list[logging.Handler]
) -> None:
    for handler in before:
        logger.removeHandler(handler)
    for handler in after:
        logger.addHandler(handler)
