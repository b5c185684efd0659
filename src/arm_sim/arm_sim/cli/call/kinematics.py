# SPDX-License-Identifier: Apache-2.0
"""Asks for joint positions that bring a frame to poses, and shows them."""

from __future__ import annotations

import click

from arm_dynamics.client.client import Postures
from arm_dynamics.client.values import NotReached
from arm_sim.cli.call.asking import (
    SHOWN,
    Question,
    asking,
    plain_rows,
    print_json,
    readable,
    say_more,
)
from arm_sim.cli.call.options import DYNAMICS
from arm_sim.cli.output import console, number, show, table
from arm_sim.cli.vectors import Vector


def inverse_kinematics(
    frame: str, pose: Vector, axes: str, seed: Vector | None,
    node: str, timeout: float, as_json: bool, joints: str,
) -> None:  # fmt: skip
    """Ask and print; a pose that is not reached ends the command with exit status 1."""
    poses, missed = plain_rows("--pose", pose), ""
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        question = Question(client, joints, {"seed": seed}, pose.batch)
        try:
            found = client.inverse_kinematics(
                frame, poses, question.given("seed"), axes=axes.replace(",", " ").split(),
                joint_names=question.order,
            )  # fmt: skip
        except NotReached as error:
            found, missed = error.found, str(error)
    if as_json:
        _print_json(question, found, missed)
    else:
        _print(question, found)
    if missed and as_json:
        raise SystemExit(1)
    if missed:
        raise click.ClickException(missed)


def _print_json(question: Question, found: Postures, missed: str) -> None:
    fields = {"position": found.q, "reached": found.reached,
              "distance": found.distance, "angle": found.angle}  # fmt: skip
    plain = {name: values.tolist() for name, values in fields.items()}
    print_json(missed, joint_names=question.names, **plain)


def _print(question: Question, found: Postures) -> None:
    unit, out = question.unit("rad", "m"), console()
    if found.q.ndim == 2:
        ends = zip(found.reached, found.distance, found.angle, strict=True)
        rows = [
            (str(k), *map(number, q), *_ended(*end))
            for k, (q, end) in enumerate(zip(readable(found.q[:SHOWN]), ends, strict=False))
        ]
        heads = (f"pose: position [{unit}]", *question.names, "reached", "off by [m]", "[rad]")
        show(out, table(heads, rows))
        say_more(len(found.q))
        return
    given = {f"seed [{unit}]": values for values in question.vectors.values()}
    cells = zip(question.names, *given.values(), readable(found.q), strict=True)
    rows = [(name, *map(number, values)) for name, *values in cells]
    show(out, table(("joint", *given, f"position [{unit}]"), rows))
    reached, distance, angle = _ended(found.reached, found.distance, found.angle)
    out.print(f"  reached: {reached}, off by {distance} m and {angle} rad")


def _ended(reached: bool, distance: float, angle: float) -> tuple[str, str, str]:
    return "yes" if reached else "no", number(distance, 2), number(angle, 2)
