# SPDX-License-Identifier: Apache-2.0
"""Files that people keep: they are written completely or not at all, and replaced audibly."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from arm_dynamics.exceptions import ArmError, NotWritten

_log = logging.getLogger(__name__)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """The file to write in the block, which takes the place of ``path`` if the block succeeds.

    Raises:
        NotWritten: If the system does not let it be written.
    """
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with writing(path):
            yield part
            warn_if_replaced(path)
            part.replace(path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """What writes ``path``: an error of the system becomes ``NotWritten``, which names the file.

    Raises:
        NotWritten: If the system does not let it be written.
    """
    try:
        yield
    except OSError as error:
        if isinstance(error, ArmError):
            raise
        raise NotWritten(f"'{path}' cannot be written: {error.strerror or error}") from None


def warn_if_replaced(path: Path) -> None:
    """Warn that a file exists, before it is overwritten."""
    if path.exists():
        _log.warning("'%s' existed and is replaced", path)
