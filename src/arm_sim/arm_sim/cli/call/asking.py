# SPDX-License-Identifier: Apache-2.0
"""Common parts of the commands of ``./arm call``: group, options, and output of answers."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.completion import Commands
from arm_sim.cli.output import console, examples, number, show, table, units
from arm_sim.cli.vectors import HOW, Vector, VectorType

if TYPE_CHECKING:
    import numpy as np

    from arm_dynamics.client import ArmClient

VECTOR = VectorType()
SHOWN = 20  # points of a batch shown on a terminal
UNITS = {  # units of revolute joints and of prismatic ones
    "position": ("rad", "m"), "seed": ("rad", "m"), "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s²", "m/s²"), "effort": ("N m", "N"), "inertia": ("kg m²", "kg"),
    "damping": ("N m s/rad", "N s/m"),
}  # fmt: skip
_DUST = 1e-14  # relative to the largest number in the table
_Command = Callable[..., Any]


@click.group(
    cls=Commands,
    epilog=examples(
        './arm call inverse-dynamics --position "0 -0.8 0 -2.4 0 1.6 0.8"',
        './arm call inverse-dynamics --position "panda_joint4=-2.4" --terms gravity',
        "./arm call model-info --json",
    ),
)
def call() -> None:
    """Call a service of a running node.

    Vectors are in model order, or by joint name; joints that are not named are zero. Start the
    nodes with ./arm dynamics SCENE and ./arm sim SCENE.
    """


# --- options -----------------------------------------------------------------------------------


DYNAMICS, SIM = "dynamics", "sim"  # nodes, and the commands that start them


def asks(
    partner: str, check: Callable[..., None] = lambda **_: None
) -> Callable[[_Command], _Command]:
    """Decorator for a command that calls a node, with the common options.

    Args:
        partner: The node. The function is called with ``client``, ``as_json`` and its own options.
            If the node does not answer or refuses, the command fails.
        check: Called with these options before the node is called.
    """

    def decorate(command: _Command) -> _Command:
        @wraps(command)
        def run(node: str, timeout: float, as_json: bool, **given: Any) -> None:
            from arm_dynamics.client import ArmClient
            from arm_dynamics.exceptions import NoAnswer, Refused

            check(**given)
            try:
                with ArmClient(node, node, timeout) as client:
                    command(client=client, as_json=as_json, **given)
            except NoAnswer as error:
                raise click.ClickException(
                    f"{error}\n  start one in another terminal: ./arm {partner} SCENE"
                    "\n  --node selects another node, --timeout waits longer"
                ) from None
            except Refused as error:
                if as_json:
                    print_json(str(error))
                    raise SystemExit(1) from None
                raise click.ClickException(f"refused: {error}") from None

        for option in (
            click.option("--json", "as_json", is_flag=True, help="Print JSON."),
            click.option("--timeout", default=5.0, show_default=True, type=click.FloatRange(0.1),
                         help="How long to wait, in s."),
            click.option("--node", default=f"/{partner}", show_default=True,
                         help="Name of the node, with its namespace."),
        ):  # fmt: skip
            option(run)
        return run

    return decorate


def vector(name: str, what: str, required: bool = False) -> Callable[[_Command], _Command]:
    """An option for joint values, which are zero if the option may be omitted and is."""
    rest = f"; {HOW}." if required else "; zero when omitted."
    return click.option(f"--{name}", type=VECTOR, required=required, help=what + rest)


def split(_: click.Context, __: click.Parameter, value: str) -> list[str]:
    """Words of an option, separated by commas or spaces."""
    return value.replace(",", " ").split()


joints = click.option(
    "--joints", default="", callback=split,
    help='Order of the vectors, e.g. "elbow shoulder"; else the model\'s.',
)  # fmt: skip


def plain_rows(option: str, given: Vector) -> Any:
    """Numbers that do not belong to joints: a row, or a row for each point of a list."""
    if given.named:
        raise click.ClickException(f"{option}: numbers without names are expected")
    return given.rows if given.batch else given.rows[0]


# --- asking ------------------------------------------------------------------------------------


class Question:
    """A request about motion: joints, their vectors, and the format of the answer.

    ``joints`` is the order of all vectors, empty for model order; vectors not given are None.
    """

    def __init__(
        self, client: ArmClient, joints: list[str], vectors: dict[str, Vector | None]
    ) -> None:
        facts = client.model_info()
        self.order = joints
        self.names = self.order or list(facts.joint_names)
        self.types = dict(zip(facts.joint_names, facts.joint_types, strict=True))
        self.vectors = {name: v.array(self.names) for name, v in vectors.items() if v is not None}
        self.batch = any(v.batch for v in vectors.values() if v is not None)

    def given(self, *names: str) -> list[np.ndarray | None]:
        """Some of the vectors; None for those that were not given."""
        return [self.vectors.get(name) for name in names]

    def points(self, values: np.ndarray) -> np.ndarray:
        """Numbers of an answer with one entry per point."""
        return values if self.vectors["position"].ndim == 2 else values[None]

    def plain(self, values: np.ndarray) -> Any:
        """Numbers for JSON: a list of points if a list of points was given."""
        return values.tolist() if self.batch else values.tolist()[0]

    def unit(self, quantity: str) -> str:
        """The unit of a quantity for these joints, or both units if both kinds occur."""
        return units((self.types.get(name, "") for name in self.names), *UNITS[quantity])


# --- showing -----------------------------------------------------------------------------------


def print_joints(question: Question, quantity: str, values: np.ndarray, title: str = "") -> None:
    """Print vectors of shape (k, n): one beside the given ones, or a line for each point.

    ``quantity`` is one of ``UNITS``, ``title`` the heading if it differs.
    """
    heading = f"{title or quantity} [{question.unit(quantity)}]"
    if question.batch:
        print_points(heading, question.names, numbers(values))
        return
    given = {f"{name} [{question.unit(name)}]": v for name, v in question.vectors.items()}
    print_columns("joint", question.names, {**given, heading: values[0]})


def print_columns(what: str, names: Sequence[str], columns: dict[str, np.ndarray]) -> None:
    """Print a line for each name, a column for each vector."""
    cells = zip(names, *map(readable, columns.values()), strict=True)
    rows = [(name, *map(number, values)) for name, *values in cells]
    show(console(), table((what, *columns), rows))


def print_matrix(title: str, names: Sequence[str], heads: Sequence[str], values: Any) -> None:
    """Print a matrix whose rows and columns have names."""
    rows = zip(names, readable(values), strict=True)
    cells = [(name, *(number(x, 5) for x in row)) for name, row in rows]
    show(console(), table((title, *heads), cells))


def print_points(
    title: str, heads: Sequence[str], rows: Sequence[Sequence[str]], what: str = "point"
) -> None:
    """Print a batch, a line for each of the first points, and the number of further points."""
    shown = [(str(k), *row) for k, row in enumerate(rows[:SHOWN])]
    show(console(), table((f"{what}: {title}", *heads), shown))
    say_more(len(rows))


def numbers(rows: np.ndarray) -> list[list[str]]:
    """Rows of numbers as text."""
    return [list(map(number, row)) for row in readable(rows)]


def readable(values: np.ndarray) -> np.ndarray:
    """The numbers with rounding errors of zeros removed."""
    return values * (abs(values) >= _DUST * abs(values).max(initial=0.0))


def say_more(points: int) -> None:
    """Print how many points of a batch are not shown."""
    if points > SHOWN:
        console().print(f"… and {points - SHOWN} more points; --json prints all")


def print_json(refusal: str = "", /, **fields: Any) -> None:
    """Print the answer of a node as JSON, with the reason if it refused."""
    head = {"success": False, "message": refusal} if refusal else {"success": True}
    click.echo(json.dumps({**head, **fields}))
