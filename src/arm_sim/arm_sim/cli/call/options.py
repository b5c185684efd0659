# SPDX-License-Identifier: Apache-2.0
"""Options that several commands of ``./arm call`` have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import click

from arm_sim.cli.vectors import HOW, VectorType

VECTOR = VectorType()

Command = Callable[..., Any]


class Partner(NamedTuple):
    """A node to be called: its name, and the command that starts one."""

    node: str
    start: str


DYNAMICS = Partner("/dynamics", "./arm dynamics SCENE")
SIM = Partner("/sim", "./arm sim SCENE")


def options(partner: Partner) -> Callable[[Command], Command]:
    """Options that every command has.

    Args:
        partner: The node that it calls.
    """

    def add(command: Command) -> Command:
        for option in (
            click.option("--json", "as_json", is_flag=True, help="Print JSON."),
            click.option("--timeout", default=5.0, show_default=True, type=click.FloatRange(0.1),
                         help="How long to wait, in s."),
            click.option("--node", default=partner.node, show_default=True, help="Node to ask."),
        ):  # fmt: skip
            command = option(command)
        return command

    return add


def vector(name: str, what: str, required: bool = False) -> Callable[[Command], Command]:
    """An option for numbers of the joints.

    Args:
        name: Its name.
        what: What the numbers are.
        required: Whether they must be given; else they are zero.
    """
    rest = f"; {HOW}." if required else "; zero when not given."
    return click.option(f"--{name}", type=VECTOR, required=required, help=what + rest)


joints = click.option(
    "--joints", default="", help='Order of the vectors, e.g. "elbow shoulder"; else the model\'s.'
)
