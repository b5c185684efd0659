# SPDX-License-Identifier: Apache-2.0
"""Asks for inverse and forward dynamics and their terms, and shows the answers."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_sim.cli.call.asking import (
    SHOWN,
    Question,
    asking,
    print_json,
    print_points,
    readable,
    say_more,
)
from arm_sim.cli.call.options import DYNAMICS
from arm_sim.cli.output import console, number, show, table
from arm_sim.cli.vectors import Vector


def inverse_dynamics(
    terms: int, node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for torques and print them."""
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        q, v, a = map(question.given, ("position", "velocity", "acceleration"))
        tau = client.inverse_dynamics(q, v, a, terms, question.order)
    print_motion(question, "effort", ("torque", "N m", "N"), tau, as_json)


def forward_dynamics(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for accelerations and print them."""
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        q, v, tau = map(question.given, ("position", "velocity", "effort"))
        a = client.forward_dynamics(q, v, tau, question.order)
    print_motion(question, "acceleration", ("acceleration", "rad/s²", "m/s²"), a, as_json)


def print_motion(
    question: Question, field: str, heading: tuple[str, str, str], answer: np.ndarray,
    as_json: bool,
) -> None:  # fmt: skip
    """Print one vector of the joints beside those that were given.

    Args:
        question: What was asked.
        field: Name of the answer in JSON.
        heading: What it is, its unit for turning joints and for sliding ones.
        answer: The numbers, shape (n,) or (k, n).
        as_json: Print JSON.
    """
    rows = question.points(answer)
    if as_json:
        print_json(joint_names=question.names, **{field: question.plain(rows)})
        return
    title, unit = heading[0], question.unit(*heading[1:])
    if question.batch:
        print_points(question.names, f"{title} [{unit}]", rows)
        return
    given = {f"{name} [{_unit_of(name, question)}]": v for name, v in question.vectors.items()}
    cells = zip(question.names, *given.values(), readable(rows[0]), strict=True)
    shown = [(name, *map(number, values)) for name, *values in cells]
    show(console(), table(("joint", *given, f"{title} [{unit}]"), shown))


def dynamics_terms(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for the parts of the equation of motion and print them."""
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        terms = client.dynamics_terms(
            question.given("position"), question.given("velocity"), question.order
        )
    ranks = {"mass_matrix": 2, "coriolis_matrix": 2, "gravity": 1, "friction": 1,
             "kinetic_energy": 0, "potential_energy": 0}  # fmt: skip
    found = {name: question.points(getattr(terms, name), rank) for name, rank in ranks.items()}
    if as_json:
        plain = {name: question.plain(values) for name, values in found.items()}
        print_json(joint_names=question.names, **plain)
        return
    of_rank = [{name: found[name] for name in ranks if ranks[name] == r} for r in (2, 1, 0)]
    _print_terms(question, *of_rank)


def _print_terms(
    question: Question,
    matrices: dict[str, Any],
    torques: dict[str, Any],
    energies: dict[str, Any],
) -> None:
    out, names = console(), question.names
    units = {"mass_matrix": question.unit("kg m²", "kg"),
             "coriolis_matrix": question.unit("N m s/rad", "N s/m")}  # fmt: skip
    points = len(energies["kinetic_energy"])
    for point in range(min(points, SHOWN)):
        if question.batch:
            out.rule(f"point {point}")
        for name, values in matrices.items():
            heading = f"{name.replace('_', ' ')} [{units[name]}]"
            rows = [
                (a, *(number(x, 5) for x in row))
                for a, row in zip(names, readable(values[point]), strict=True)
            ]
            show(out, table((heading, *names), rows))
        heads = [f"{name} [{question.unit('N m', 'N')}]" for name in torques]
        cells = zip(names, *(readable(values[point]) for values in torques.values()), strict=True)
        show(out, table(("joint", *heads), [(a, *map(number, x)) for a, *x in cells]))
        for name, values in energies.items():
            out.print(f"  {name.replace('_', ' ')}: {number(values[point])} J")
    say_more(points)


def _unit_of(name: str, question: Question) -> str:
    units = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"),
             "acceleration": ("rad/s²", "m/s²"), "effort": ("N m", "N")}  # fmt: skip
    return question.unit(*units[name])
