# SPDX-License-Identifier: Apache-2.0
"""Tables in text files: from bytes to text, rows and numbers; errors name row and column."""

import codecs
import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any, Self

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, plain

_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_ENCODINGS = "UTF-8, or UTF-16 with a byte-order mark, is expected"
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_MISSING = ("", "nan", "na", "n/a", "null", "none")
_POINTS = str.maketrans({",": ".", ".": "?"})  # of a column with decimal commas
_DATE = re.compile(
    r"(?:(\d{4}-\d\d-\d\d|\d\d\.\d\d\.\d{4})[T ])?(\d?\d:\d\d:\d\d)(?:[.,](\d{1,9}))?"
    r" ?(Z|[+-]\d\d:?\d\d)?"
)
_CELL = (
    "allowed: a finite number without thousands separators, with a decimal point (or comma in "
    "every row of the column, if ';' or tabs separate columns); or nothing, where it is missing"
)
_TIME = "allowed: a number, or a time such as 13:45:00.125 or 2025-05-31 13:45:00.125"
_EPOCH = 1e8  # [s] above which times count from 1970
_CLOCKS = {1e17: ("ns", 1e-9), 1e14: ("us", 1e-6), 1e11: ("ms", 1e-3)}  # by their least size then
_SHORTEST, _LONGEST = 1e-5, 0.99  # [s] between rows: beyond them another unit is likely


def value(cell: str) -> float | None:
    """The number in a cell: NaN if it is missing, None if it is something else."""
    if _NUMBER.fullmatch(cell):
        return float(cell) if math.isfinite(float(cell)) else None
    return float("nan") if cell.lstrip("+-").lower() in _MISSING else None


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes:
        path: Its file.
        names: Names of the columns; empty if it has no header.
        rows: Cells of each row.
        lines: Number of each row in the file.
        commas: Whether a comma in a cell is a decimal one, since it is not the separator.
        notes: Rows that are left out, and interpretations that users should know.
    """

    path: Path
    names: Sequence[str]
    rows: Sequence[Sequence[str]]
    lines: Sequence[int]
    commas: bool = False
    notes: list[str] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read UTF-8, or UTF-16 with a mark; columns between tabs, semicolons, commas or spaces.

        Raises:
            InvalidInput: If it is not text, or a row has another length than the header.
        """
        text, notes = _text(path), list[str]()
        try:
            names, rows, separator = _rows(text)
        except csv.Error as error:
            raise _bad(path, str(error)) from None
        if not text.endswith(("\n", "\r")) and _cut_off([row for _, row in rows], len(names)):
            notes.append(f"row {rows.pop()[0]} is cut off and left out")
        if not rows:
            raise _bad(path, "it has no rows below a header")
        for line, row in rows if names else ():
            if len(row) != len(names):
                too_many = separator == "," and len(row) > len(names)
                hint = "; with decimal commas, ';' is expected between columns" if too_many else ""
                counts = f"row {line} has {len(row)} columns, the header {len(names)}"
                raise _bad(path, counts + hint)
        if repeated := [name for name in names if name and names.count(name) > 1]:
            raise _bad(path, f"two columns are named '{repeated[0]}'; one is expected")
        lines, cells = zip(*rows, strict=True)
        return cls(path, names, cells, lines, separator != ",", notes)

    def error(self, row: int, column: int, why: str) -> InvalidInput:
        """That a cell is refused."""
        name = self.names[column] if self.names else column + 1
        cell, line = plain(self.rows[row][column], 40), self.lines[row]
        return InvalidInput(f"'{self.path}': row {line}, column '{name}' = '{cell}': {why}")

    def numbers(self, column: int, allowed: str = _CELL) -> Array:
        """Numbers of a column; NaN where they are missing."""
        numbers = [value(cell) for cell in self._cells(column)]
        if None in numbers:
            raise self.error(numbers.index(None), column, allowed)
        return np.array(numbers, float)

    def _cells(self, column: int) -> list[str]:
        """Cells of a column, with decimal points."""
        cells = [row[column] for row in self.rows]
        if self.commas and any("," in cell for cell in cells):
            return [cell.translate(_POINTS) for cell in cells]
        return cells

    def times(self, column: int, factor: float = 1.0) -> Array:
        """Times in [s], which increase; those of a calendar count from the first one.

        Args:
            column: Its place.
            factor: Seconds per unit by the column's name.
        """
        stamps = [_nanoseconds(row[column]) for row in self.rows]
        times: Array
        if stamps[0] is None:
            times = self._counted(column, factor)
        elif None in stamps:
            raise self.error(stamps.index(None), column, _TIME)
        else:
            self.notes.append(f"time counts from {self.rows[0][column]}")
            times = 1e-9 * np.asarray(np.array(stamps, np.int64) - stamps[0], float)
        if back := np.flatnonzero(np.diff(times) <= 0.0).tolist():
            before = self.rows[back[0]][column]
            raise self.error(back[0] + 1, column, f"it does not increase, after {before}")
        return times

    def _counted(self, column: int, factor: float) -> Array:
        """Times that are numbers."""
        times, cells, name = self.numbers(column, _TIME), self._cells(column), self.names[column]
        if missing := np.flatnonzero(np.isnan(times)).tolist():
            raise self.error(missing[0], column, _TIME)
        units = [unit for least, unit in _CLOCKS.items() if factor == 1.0 and times[0] >= least]
        unit, factor = units[0] if units else ("", factor)
        if factor * times[0] > _EPOCH:
            first = Decimal(cells[0])
            times = np.array([float(Decimal(cell) - first) for cell in cells])
            self.notes.append(f"time counts from {first}{unit and f', read as {unit} since 1970'}")
        step = float(np.median(np.diff(times))) if len(times) > 1 else _SHORTEST
        if factor == 1.0 and not _SHORTEST <= step < _LONGEST:
            self.notes.append(
                f"'{name}' has steps of {step:.3g}, read as s; another unit is stated in the "
                f"name, as in '{name} [ms]'"
            )
        return factor * times


def _nanoseconds(cell: str) -> int | None:
    """A time of day, or since 1970, in [ns]; None if the cell is none."""
    if not (match := _DATE.fullmatch(cell)):
        return None
    date, clock, fraction, zone = match.groups(default="")
    if "." in date:
        date = "-".join(reversed(date.split(".")))
    try:
        whole = datetime.fromisoformat(f"{date or '1970-01-01'} {clock.zfill(8)}{zone or 'Z'}")
    except ValueError:
        return None
    return int(whole.timestamp()) * 10**9 + int(fraction.ljust(9, "0"))


def _bad(path: Path, why: str) -> InvalidInput:
    return InvalidInput(f"'{path}' is not a table of numbers: {why}")


def _text(path: Path) -> str:
    """The text of a file, in the encoding that its first bytes tell, else UTF-8."""
    raw = path.read_bytes()
    encoding = next((name for mark, name in _MARKS.items() if raw.startswith(mark)), "utf-8")
    try:  # not to the end, which may be within a character
        text = codecs.getincrementaldecoder(encoding)().decode(raw)
    except UnicodeDecodeError as error:
        row = raw.count(b"\n", 0, error.start) + 1
        raise _bad(path, f"row {row} is not {encoding.upper()}; {_ENCODINGS}") from None
    if "\0" in text:
        raise _bad(path, f"it contains zero bytes; {_ENCODINGS}")
    return text.removeprefix("\ufeff")


def _rows(text: str) -> tuple[list[str], list[tuple[int, list[str]]], str]:
    """Names of the columns, cells of each row with its number in the file, and the separator.

    Above the header there may be comments, of which the last may be the header, and the separator.
    """
    lines = text.splitlines()
    content = (i for i, x in enumerate(lines) if x.strip() and not x.startswith(("#", "sep=")))
    start = next(content, len(lines))
    reader, separator = _reader(lines[start:])
    rows = [(start + reader.line_num, row) for row in map(_stripped, reader) if row]
    if rows and not (_NUMBER.fullmatch(rows[0][1][0]) or _DATE.fullmatch(rows[0][1][0])):
        return rows.pop(0)[1], rows, separator
    comments = [line.lstrip("# ") for line in lines[:start] if line.startswith("#")]
    for names in map(_stripped, _reader(comments[-1:])[0]):
        if rows and len(names) == len(rows[0][1]):
            return names, rows, separator
    return [], rows, separator


def _reader(lines: list[str]) -> tuple[Any, str]:
    separator = next((mark for mark in "\t;," if lines and mark in lines[0]), " ")
    stripped = (line.strip(" ") for line in lines)
    return csv.reader(stripped, delimiter=separator, skipinitialspace=True), separator


def _stripped(row: list[str]) -> list[str]:
    return [cell.strip() for cell in row]


def _cut_off(rows: list[list[str]], width: int) -> bool:
    """Whether the last row, at the end of the file without a line end, seems incomplete."""
    if len(rows) < 2:
        return bool(rows) and len(rows[0]) < width
    *complete, last = rows
    shortest = min(len(row[-1]) for row in complete)
    number = value(last[-1].replace(",", "."))
    return len(last) < len(complete[-1]) or number is None or len(last[-1]) < shortest
