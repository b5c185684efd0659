# SPDX-License-Identifier: Apache-2.0
"""Values on the command line: vectors, in model order, by joint name or of many points; names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Any

import click

from arm_dynamics.exceptions import choices
from arm_sim.cli.output import shortened

HOW = 'e.g. "0, 0.5, -1", "elbow=0.5 wrist=-1", "[[0, 1], [2, 3]]" for two points, or @FILE'


@dataclass(frozen=True)
class Vector:
    """Numbers as rows, or by name.

    Attributes:
        rows: One row for each point; empty if names were given.
        named: Numbers by joint name.
        batch: Whether a list of points was given, so that the answer is a list.
    """

    rows: tuple[tuple[float, ...], ...]
    named: Mapping[str, float]
    batch: bool = False

    def flat(self, names: Sequence[str]) -> list[float]:
        """Numbers point after point, with joints in this order; zero for joints not named."""
        unknown = [name for name in self.named if name not in names]
        if unknown:
            raise click.ClickException(
                f"unknown joint {', '.join(map(repr, unknown))}; "
                f"allowed: {choices(unknown[0], names)}"
            )
        if self.named:
            return [self.named.get(name, 0.0) for name in names]
        return [value for row in self.rows for value in row]


class VectorType(click.ParamType):
    """The click type of ``parse``.

    Args:
        name: What help shows.
        size: Length of the one row that is expected; None: anything is.
        row: What its numbers are.
    """

    def __init__(self, name: str = "numbers", size: int | None = None, row: str = "") -> None:
        self.name, self._size, self._row = name, size, row

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Vector:
        """Parse an argument, or fail with a usage error."""
        try:
            vector = value if isinstance(value, Vector) else parse(value)
        except OSError as error:
            self.fail(f"'{error.filename}': {error.strerror}; {HOW}", param, ctx)
        except ValueError as error:
            self.fail(f"{error}; {HOW}", param, ctx)
        if self._size and [len(row) for row in vector.rows] != [self._size]:
            self.fail(f"{value!r}; {self._size} numbers are expected, {self._row}", param, ctx)
        return vector


class WordsType(click.ParamType):
    """Names, with commas or spaces between them."""

    name = "text"

    def convert(self, value: str, param: Any, ctx: click.Context | None) -> Any:
        """List them."""
        return value.replace(",", " ").split()


class BitsType(WordsType):
    """Names of bits of a number.

    Args:
        bits: The bits by name.
    """

    name = "names"

    def __init__(self, bits: Mapping[str, int]) -> None:
        self._bits = bits

    def convert(self, value: str, param: Any, ctx: click.Context | None) -> int:
        """The number with these bits, or a usage error."""
        names = set(super().convert(value.lower(), param, ctx))
        unknown = min(names - {*self._bits}, default="")
        if unknown or not names:
            self.fail(f"{value!r}; allowed: some of {choices(unknown, self._bits)}", param, ctx)
        return reduce(or_, (self._bits[name] for name in names))


def parse(text: str) -> Vector:
    """Parse a vector.

    Args:
        text: Numbers with commas or spaces between them, ``name=number`` likewise, JSON or YAML,
            or ``@`` and the name of a file that holds any of these, a line for each point.

    Raises:
        ValueError: If it is none of these.
        OSError: If the file cannot be read.
    """
    if text.startswith("@"):
        text = Path(text[1:]).read_text(encoding="utf-8")
    text = text.strip()
    if text[:1] in ("[", "{"):
        return _structured(text)
    lines = [line.replace(",", " ").split() for line in text.splitlines() if line.strip()]
    if not lines:
        raise ValueError("no numbers given")
    if "=" in text:
        named = {}
        for word in (word for line in lines for word in line):
            name, _, value = word.partition("=")
            if not name or not value:
                raise ValueError(f"{word!r} is not of the form joint=number")
            if name in named:
                raise ValueError(f"joint {name!r} is named twice")
            named[name] = _number(value)
        return Vector((), named)
    if len({len(line) for line in lines}) > 1:
        problem = "does not have the same number of values on every line"
        raise ValueError(f"{shortened(text)!r} {problem}")
    return Vector(tuple(tuple(map(_number, line)) for line in lines), {}, len(lines) > 1)


def _structured(text: str) -> Vector:
    """Numbers, rows of numbers, or numbers by joint, from JSON or YAML."""
    import yaml

    try:
        data = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ValueError(f"{shortened(text)!r} is neither JSON nor YAML") from None
    if not data:
        raise ValueError("no numbers given")
    if isinstance(data, dict):
        if len(data) < len(yaml.compose(text, yaml.SafeLoader).value):
            raise ValueError(f"{shortened(text)!r} names a joint twice")
        return Vector((), {str(name): _number(value) for name, value in data.items()})
    nested = any(isinstance(row, list) for row in data)
    rows = data if nested else [data]
    if not all(isinstance(row, list) and row and len(row) == len(rows[0]) for row in rows):
        raise ValueError(f"{shortened(text)!r} is not a list of numbers, nor lists of one length")
    return Vector(tuple(tuple(map(_number, row)) for row in rows), {}, nested)


def _number(value: Any) -> float:
    try:
        if isinstance(value, bool):
            raise ValueError
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{value!r} is not a number") from None
