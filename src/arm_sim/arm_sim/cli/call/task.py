# SPDX-License-Identifier: Apache-2.0
"""Asks for the equation of motion at a frame and shows the answer."""

from __future__ import annotations

from typing import Any

import click
import numpy as np

from arm_sim.cli.call.asking import SHOWN, Question, asking, print_json, readable, say_more
from arm_sim.cli.call.options import DYNAMICS
from arm_sim.cli.output import console, number, show, table
from arm_sim.cli.vectors import Vector

_VECTORS = ("twist", "bias", "coriolis", "gravity")
_NUMBERS = ("manipulability", "condition", "damped", "effective_mass", "effective_mass_bounded")


def task_space(
    frame: str, reference: str, axes: str, direction: Vector | None,
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None,
) -> None:  # fmt: skip
    """Ask and print."""
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        found = client.task_space(
            frame, question.given("position"), question.given("velocity"), reference=reference,
            axes=axes.replace(",", " ").split(),
            direction=() if direction is None else _plain_row(direction),
            joint_names=question.order,
        )  # fmt: skip
    names = list(found.pop("axes"))
    found.pop("joint_names")
    answer = {
        name: values if question.vectors["position"].ndim == 2 else values[None]
        for name, values in found.items()
    }
    if as_json:
        plain = {name: _plain(question.plain(values)) for name, values in answer.items()}
        print_json(joint_names=question.names, axes=names, **plain)
    else:
        _print(question, names, answer)


def _plain_row(direction: Vector) -> list[float]:
    if len(direction.rows) != 1:
        raise click.ClickException("--direction: one row of numbers is wanted, one for each axis")
    return list(direction.rows[0])


def _plain(values: Any) -> Any:
    """JSON knows no infinity: a condition without bound is null."""
    if isinstance(values, list):
        return [_plain(value) for value in values]
    return None if values == float("inf") else values


def _print(question: Question, axes: list[str], answer: dict[str, np.ndarray]) -> None:
    out, points = console(), len(answer["damped"])
    for k in range(min(points, SHOWN)):
        if question.batch:
            out.rule(f"point {k}")
        pose = [number(x) for x in readable(answer["pose"][k])]
        out.print(f"\n  position {', '.join(pose[:3])} m, quaternion xyzw {', '.join(pose[3:])}")
        for name, heads in (("inertia", axes), ("jacobian", question.names)):
            rows = zip(axes, readable(answer[name][k]), strict=True)
            cells = [(axis, *(number(x, 5) for x in row)) for axis, row in rows]
            show(out, table((_HEADS[name], *heads), cells))
        columns = (readable(answer[name][k]) for name in _VECTORS)
        cells = [(axis, *map(number, row)) for axis, *row in zip(axes, *columns, strict=True)]
        show(out, table(("axis", *(_HEADS[name] for name in _VECTORS)), cells))
        _print_numbers(out, {name: answer[name][k] for name in _NUMBERS if name in answer})
    say_more(points)


_HEADS = {
    "inertia": "inertia [kg, kg m, kg m²]",
    "jacobian": "Jacobian",
    "twist": "velocity [m/s, rad/s]",
    "bias": "bias [m/s², rad/s²]",
    "coriolis": "Coriolis [N, N m]",
    "gravity": "gravity [N, N m]",
}


def _print_numbers(out: Any, numbers: dict[str, Any]) -> None:
    out.print(
        f"  manipulability {number(numbers['manipulability'])}, "
        f"condition {number(numbers['condition'])}"
    )
    if "effective_mass" in numbers:
        at_least = "at least " if numbers["effective_mass_bounded"] else ""
        out.print(f"  mass along the direction: {at_least}{number(numbers['effective_mass'])}")
    if numbers["damped"]:
        out.print("  near a singularity: inertia, Coriolis and gravity are bounded, not exact")
