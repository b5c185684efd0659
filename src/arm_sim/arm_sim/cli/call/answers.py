# SPDX-License-Identifier: Apache-2.0
"""Answers of nodes: the fields of a response as tables, or as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.call.services import Field, Service
from arm_sim.cli.output import console, number, say, table, to_json
from arm_sim.cli.vectors import Vector

if TYPE_CHECKING:
    import numpy as np

SHOWN = 20  # points of a batch shown on a terminal
_ROUNDING = 1e-14  # of zeros, relative to the largest number in the table


class Answer:
    """A response with its arrays in their shapes.

    Args:
        service: The service.
        response: The response.
        request: Vectors of the request.
        joints: Types of the joints by name, in the order of all vectors.
    """

    def __init__(
        self, service: Service, response: Any, request: Mapping[Field, Vector],
        joints: Mapping[str, str],
    ) -> None:  # fmt: skip
        self._request = {field: vector for field, vector in request.items() if "k" in field.shape}
        self._batch = any(vector.batch for vector in self._request.values())
        self._count = next((len(x.rows) for x in self._request.values()), 0) or 1
        self._joint_types = set(joints.values())
        self._names = {"n": list(joints)}  # of rows and columns, by dimension
        self._lists: dict[str, Field] = {}  # the fields that contain them
        for field in service.response:
            if field.type == "string[]" and field.shape and field.shape[0] not in self._lists:
                self._lists[field.shape[0]] = field
                self._names[field.shape[0]] = list(getattr(response, field.name))
        self._check_request()
        self._values = self._shaped(service.response, response)

    def _shaped(self, fields: Sequence[Field], response: Any) -> dict[Field, Any]:
        """Values of a response, arrays in their shapes; none that is left empty."""
        import numpy as np

        values = dict[Field, Any]()
        for field in fields:
            value, shape = getattr(response, field.name), [self._size(dim) for dim in field.shape]
            if not shape:
                values[field] = value
            elif len(value) or not math.prod(shape):
                values[field] = np.array(value).reshape(shape)
        return values

    def _check_request(self) -> None:
        """Refuse rows of another length than their names: several points are to be listed so."""
        for field, vector in self._request.items():
            size, row = self._size(field.shape[-1]), len(vector.rows[0]) if vector.rows else 0
            if row not in (0, size):
                raise click.ClickException(f"{field.name} has rows of {row}; allowed: {size}")

    def _size(self, dim: str) -> int:
        if dim == "k":
            return self._count
        return int(dim) if dim.isdigit() else len(self._names[dim])

    def print_json(self, refusal: str) -> None:
        """Print all fields as JSON, without k unless points were listed."""
        print_json(refusal, **{
            field.name: value[0] if "k" in field.shape and not self._batch else value
            for field, value in self._values.items()
        })  # fmt: skip

    # --- tables --------------------------------------------------------------------------------

    def print(self) -> None:
        """Print tables: by joint or axis, or with a line for each point of a batch."""
        values = {x: v for x, v in self._values.items() if x not in self._lists.values()}
        if self._batch and all(len(field.shape) < 3 for field in values):
            self._print_rows(values)
        else:
            for k in range(min(self._count, SHOWN)):
                if self._batch:
                    console().rule(f"point {k}")
                self._print_point({x: v[k] if "k" in x.shape else v for x, v in values.items()})
        if self._count > SHOWN:
            say(f"… and {self._count - SHOWN} more points; --json prints all")

    def _print_rows(self, values: Mapping[Field, Any]) -> None:
        """Print a table for each vector of the answer; the first has the numbers, too."""
        sent = {field.name for field in self._request}
        rows = {x: v[:SHOWN] for x, v in values.items() if "k" in x.shape and x.name not in sent}
        numbers = [(self._title(x), v) for x, v in rows.items() if len(x.shape) == 1]
        tables: dict[str, list[tuple[str, Any]]] = {}
        for field, vectors in rows.items():
            if len(field.shape) == 2 and vectors.size:
                names = self._names.get(field.shape[1]) or list(map(str, range(vectors.shape[1])))
                columns = zip(_numbered(names), readable(vectors).T, strict=True)
                tables[f"point: {self._title(field)}"] = list(columns)
        for title, columns in (tables or {"point": []}).items():
            points = map(str, range(min(self._count, SHOWN)))
            _print_table(title, points, [*columns, *numbers])
            numbers = []
        for field, value in values.items():
            if "k" not in field.shape or not value.size:
                self._print_line(field, value)

    def _print_point(self, values: Mapping[Field, Any]) -> None:
        """Print matrices, then vectors with the same rows beside each other, then the rest."""
        import numpy as np

        vectors: dict[str, dict[str, Any]] = {}
        rest = []
        for field, value in values.items():
            dims = [dim for dim in field.shape if dim != "k"]
            if not dims or not all(map(self._names.get, dims)):
                rest.append((field, value))
            elif len(dims) == 1:
                vectors.setdefault(dims[0], {})[self._title(field)] = value
            else:
                rows, heads = (_numbered(self._names[dim]) for dim in dims)
                columns = list(zip(heads, readable(value).T, strict=True))
                _print_table(self._title(field), rows, columns, digits=5)
        for dim, columns in vectors.items():
            names = self._names[dim]
            requested = {
                self._title(field): np.array(vector.flat(names))
                for field, vector in self._request.items()
                if field.shape == ("k", dim) and not self._batch
            }
            head = self._lists[dim].name.removesuffix("_names") if dim in self._lists else "joint"
            _print_table(head, _numbered(names), list((requested | columns).items()))
        for field, value in rest:
            self._print_line(field, value)

    def _print_line(self, field: Field, value: Any) -> None:
        """Print entries without names, and what it means if they are true."""
        import numpy as np

        text = ", ".join(_cells(np.ravel(value)))
        if field.type == "bool[]" and value:
            text += f" ({field.about})"
        say(f"  {self._title(field)}: {text or 'none'}")

    def _title(self, field: Field) -> str:
        """Name and unit of a field, both units if both kinds of joints occur; or its comment."""
        name, units = field.name.replace("_", " "), field.units
        if field.shape and field.shape[-1].isdigit():  # only the comment says what each entry is
            return f"{name} ({field.about})"
        sliding = {joint_type == "prismatic" for joint_type in self._joint_types}
        if "n" in field.shape and len(sliding) == 1:
            units = units[-1:] if sliding == {True} else units[:1]
        return f"{name} [{', '.join(units)}]" if units else name


def _print_table(
    title: str, names: Iterable[str], columns: Sequence[tuple[str, Any]], digits: int = 6
) -> None:
    """Print a line for each name, and columns with their headings."""
    cells = (_cells(values, digits) for _, values in columns)
    heads = (title, *(head for head, _ in columns))
    text = [0, *(i for i, (_, values) in enumerate(columns, 1) if values.dtype.kind == "U")]
    say(table(heads, zip(names, *cells, strict=True), text))


def _cells(values: np.ndarray, digits: int = 6) -> list[str]:
    """Entries of a column as text."""
    if values.dtype.kind == "f":
        return [number(x, digits) for x in readable(values).tolist()]
    return [x if isinstance(x, str) else "yes" if x else "no" for x in values.tolist()]


def readable(values: np.ndarray) -> np.ndarray:
    """The numbers with rounding errors of zeros removed."""
    import numpy as np

    largest = abs(values[np.isfinite(values)]).max(initial=0.0)
    return np.where(abs(values) >= _ROUNDING * largest, values, 0.0)


def _numbered(names: Sequence[str]) -> list[str]:
    """Names, with numbers where one is repeated."""
    return [
        f"{name} {names[: k + 1].count(name)}" if names.count(name) > 1 else name
        for k, name in enumerate(names)
    ]


def print_json(refusal: str = "", **fields: Any) -> None:
    """Print an answer as JSON, with the reason if the node refused."""
    head = {"success": False, "message": refusal} if refusal else {"success": True}
    click.echo(to_json(head | fields))
