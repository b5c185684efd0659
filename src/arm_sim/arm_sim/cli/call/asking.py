# SPDX-License-Identifier: Apache-2.0
"""Asks running nodes; what every command of ``./arm call`` needs to show the answer."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click
import numpy as np

from arm_dynamics.client.client import ArmClient
from arm_dynamics.exceptions import NoAnswer, Refused
from arm_sim.cli.output import console, number, show, table
from arm_sim.cli.vectors import Vector

SHOWN = 20  # points of a batch on a terminal
_DUST = 1e-14  # of the largest number beside it


@contextmanager
def asking(node: str, start: str, timeout: float, as_json: bool) -> Iterator[ArmClient]:
    """A client of one node; what goes wrong ends the command.

    Args:
        node: Name of the node.
        start: The command that starts such a node.
        timeout: How long to wait in [s].
        as_json: Whether a refusal is told as JSON.
    """
    with ArmClient(node, node, timeout) as client:
        try:
            yield client
        except NoAnswer as error:
            raise click.ClickException(
                f"{error}\n  start one in another terminal: {start}"
                "\n  --node chooses another node, --timeout waits longer"
            ) from None
        except Refused as error:
            if as_json:
                print_json(str(error))
                raise SystemExit(1) from None
            raise click.ClickException(f"refused: {error}") from None


class Question:
    """A question about motion: joints, their vectors, and how the answer is to look.

    Args:
        client: Of the node that is asked.
        joints: Names of the joints in the order of all vectors; none for the model's.
        vectors: Numbers of the joints by what they are, None where they were not given.
        batch: Whether several points are meant, whatever the vectors say.
    """

    def __init__(
        self,
        client: ArmClient,
        joints: str,
        vectors: dict[str, Vector | None],
        batch: bool = False,
    ) -> None:
        facts = client.model_info()
        self.order = joints.replace(",", " ").split()
        self.names = self.order or list(facts.joint_names)
        self.types = dict(zip(facts.joint_names, facts.joint_types, strict=True))
        self.vectors = {name: v.array(self.names) for name, v in vectors.items() if v is not None}
        self.batch = batch or any(v.batch for v in vectors.values() if v is not None)

    def given(self, name: str) -> np.ndarray | None:
        """One of the vectors, None if it was not given."""
        return self.vectors.get(name)

    def points(self, values: np.ndarray, rank: int = 1) -> np.ndarray:
        """Numbers of an answer, of ``rank`` dimensions a point, as one entry a point."""
        return values[None] if values.ndim == rank else values

    def plain(self, values: np.ndarray) -> Any:
        """Numbers for JSON: a list of points if points were given as a list."""
        return values.tolist() if self.batch else values.tolist()[0]

    def unit(self, turning: str, sliding: str) -> str:
        """The unit of the joints at hand, both where both kinds are."""
        kinds = {self.types.get(name) == "prismatic" for name in self.names}
        return ", ".join([turning] * (False in kinds) + [sliding] * (True in kinds))


def plain_rows(option: str, given: Vector) -> np.ndarray:
    """Numbers that belong to no joints: a row, or a row for each point if several were meant."""
    if given.named:
        raise click.ClickException(f"{option}: numbers alone are wanted, without names")
    return np.array(given.rows if given.batch else given.rows[0], float)


def print_points(heads: Sequence[str], title: str, rows: np.ndarray) -> None:
    """Print a batch, a line for each point.

    Args:
        heads: What each column is.
        title: What the numbers are.
        rows: The numbers, a row for each point.
    """
    shown = [(str(k), *map(number, row)) for k, row in enumerate(readable(rows[:SHOWN]))]
    show(console(), table((f"point: {title}", *heads), shown))
    say_more(len(rows))


def readable(values: np.ndarray) -> np.ndarray:
    """The same without the dust that rounding leaves where zero is meant."""
    return np.where(np.abs(values) < _DUST * np.abs(values).max(initial=0.0), 0.0, values)


def say_more(points: int) -> None:
    """Say how many points of a batch were not shown."""
    if points > SHOWN:
        console().print(f"… and {points - SHOWN} more points; --json prints all")


def print_json(refusal: str = "", /, **fields: Any) -> None:
    """Print an answer for scripts.

    Args:
        refusal: What the node would not do.
        **fields: What it answered.
    """
    head = {"success": False, "message": refusal} if refusal else {"success": True}
    click.echo(json.dumps({**head, **fields}))
