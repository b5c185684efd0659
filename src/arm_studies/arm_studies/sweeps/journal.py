# SPDX-License-Identifier: Apache-2.0
"""The journal: rows in the order of completion, from which an interrupted sweep continues.

The first line of JSON identifies the study; each further line is one run. Numbers are written such
that they are read back exactly.
"""

import fcntl
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from arm_dynamics.exceptions import InvalidInput, plain
from arm_studies.sweeps.runs import Row

NAME = "runs.jsonl"
_FORMAT = 1  # of the file; a journal of another one is not continued


class Journal:
    """Rows of one study in a folder, by one process at a time.

    Attributes:
        rows: Existing rows by number.
        dropped: Whether a damaged last line was dropped.

    Args:
        folder: Folder of the file.
        inputs: Inputs of the rows, by key; a file of another study is rejected.

    Raises:
        InvalidInput: If the file is not of this study, or another process writes it.
        OSError: If it cannot be read or written.
    """

    def __init__(self, folder: Path, inputs: Mapping[str, Any]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path, self.rows, self.dropped = folder / NAME, dict[int, Row](), False
        self._file = open(self.path, "a+b")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._read({"format": _FORMAT, **inputs})
        except BaseException as error:
            self._file.close()
            if not isinstance(error, BlockingIOError):
                raise
            raise InvalidInput(
                f"'{self.path}' is being written by another sweep; another folder is expected"
            ) from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def add(self, rows: Iterable[Row]) -> None:
        """Write rows; they are on disk when this returns."""
        for row in rows:
            self.rows[row.index] = row
            line = json.dumps([row.index, row.status, row.note, *row.metrics])
            self._file.write(f"{line}\n".encode())
        self._file.flush()

    def _read(self, expected: dict[str, Any]) -> None:
        self._file.seek(0)
        content = self._file.read()
        whole = content.rfind(b"\n") + 1
        lines = content[:whole].splitlines()
        self._check_head(lines, expected)
        good = len(lines[0]) + 1 if lines else 0
        for number, line in enumerate(lines[1:], 2):
            row = _row(line)
            if row is None:
                if number < len(lines):
                    raise InvalidInput(
                        f"'{self.path}', line {number}: not a run; another folder is expected"
                    )
                break
            self.rows[row.index] = row
            good += len(line) + 1
        self.dropped = good < len(content)
        self._file.truncate(good)
        if not lines:
            self._file.write(json.dumps(expected).encode() + b"\n")
            self._file.flush()

    def _check_head(self, lines: list[bytes], expected: dict[str, Any]) -> None:
        if not lines:
            return  # new, or interrupted while its first line was written
        try:
            head = json.loads(lines[0])
        except ValueError:
            head = None
        if not isinstance(head, dict) or "format" not in head:
            raise InvalidInput(
                f"'{self.path}' is not the journal of a sweep; another folder is expected"
            )
        expected = json.loads(json.dumps(expected))
        if (difference := _difference(head, expected)) is not None:
            key, was, now = difference
            raise InvalidInput(
                f"'{self.path}' holds runs of another study: '{key}' was {_short(was)} and is "
                f"{_short(now)}; undo the change, or name another folder"
            )


_MISSING = "not given"


def _difference(was: Any, now: Any, place: str = "") -> tuple[str, Any, Any] | None:
    """The first key in which two contents differ, and both values; None if they are equal."""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in (*was, *(key for key in now if key not in was)):
            inner = f"{place}.{key}".lstrip(".")
            difference = _difference(was.get(key, _MISSING), now.get(key, _MISSING), inner)
            if difference is not None:
                return difference
        return None
    return None if was == now else (place, was, now)


def _short(value: Any) -> str:
    return plain(value if value == _MISSING else json.dumps(value), 120)


def _row(line: bytes) -> Row | None:
    """The run of a line; None if it is not one."""
    try:
        index, status, note, *metrics = json.loads(line)
        return Row(int(index), str(status), str(note), tuple(map(float, metrics)))
    except (ValueError, TypeError):
        return None
