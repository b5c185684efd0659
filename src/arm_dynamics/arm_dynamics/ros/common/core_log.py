# SPDX-License-Identifier: Apache-2.0
"""What the cores log, said by the node of the process: on its console and on ``/rosout``."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.node import Node

CORES = ("arm_dynamics", "arm_sim")


class NodeHandler(logging.Handler):
    """Hands records to a node's logger, as information or as warnings."""

    def __init__(self, node: Node) -> None:
        """Speak for ``node``."""
        super().__init__(logging.INFO)
        self._log = node.get_logger()

    def emit(self, record: logging.LogRecord) -> None:
        """Say one record; ROS wants a line of code of its own for each severity."""
        if record.levelno >= logging.WARNING:
            self._log.warning(record.getMessage())
        else:
            self._log.info(record.getMessage())


@contextmanager
def core_log_of(node: Node) -> Iterator[None]:
    """Let a node say what the cores log from INFO on, while the context lasts."""
    handler = NodeHandler(node)
    loggers = [logging.getLogger(name) for name in CORES]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.removeHandler(handler)
            logger.setLevel(level)
