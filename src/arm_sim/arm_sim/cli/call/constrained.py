# SPDX-License-Identifier: Apache-2.0
"""Asks for motion and forces under a scene's constraints, and shows the answers."""

from __future__ import annotations

from collections import Counter

import numpy as np

from arm_sim.cli.call.asking import (
    Question,
    asking,
    plain_rows,
    print_json,
    print_points,
    readable,
)
from arm_sim.cli.call.motion import print_motion
from arm_sim.cli.call.options import DYNAMICS
from arm_sim.cli.output import console, number, show, table
from arm_sim.cli.vectors import Vector

_UNIT = "N, N m"


def forward(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for accelerations and forces against the constraints, and print them."""
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        q, v, tau = map(question.given, ("position", "velocity", "effort"))
        found = client.constrained_dynamics(q, v, tau, question.order)
    names, forces = found.constraint_names, question.points(found.multipliers)
    if as_json:
        print_json(
            joint_names=question.names, constraint_names=list(names),
            acceleration=question.plain(question.points(found.acceleration)),
            multipliers=question.plain(forces),
        )  # fmt: skip
        return
    print_motion(question, "", ("acceleration", "rad/s²", "m/s²"), found.acceleration, False)
    if names:
        _print_forces(_numbered(names), forces, question.batch)
    else:
        console().print("  the scene has no constraints")


def inverse(
    multipliers: Vector | None,
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None,
) -> None:  # fmt: skip
    """Ask for the torques of a motion and of forces against the constraints, and print them."""
    forces = None if multipliers is None else plain_rows("--multipliers", multipliers)
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        q, v, a = map(question.given, ("position", "velocity", "acceleration"))
        tau = client.constrained_inverse_dynamics(q, v, a, forces, question.order)
    print_motion(question, "effort", ("torque", "N m", "N"), tau, as_json)


def _print_forces(names: list[str], forces: np.ndarray, batch: bool) -> None:
    if batch:
        print_points(names, f"force [{_UNIT}]", forces)
        return
    rows = [(name, number(f)) for name, f in zip(names, readable(forces[0]), strict=True)]
    show(console(), table(("constraint", f"force [{_UNIT}]"), rows))


def _numbered(names: tuple[str, ...]) -> list[str]:
    """Tell the numbers of one constraint apart."""
    several, met, told = Counter(names), Counter[str](), []
    for name in names:
        met[name] += 1
        told.append(f"{name} {met[name]}" if several[name] > 1 else name)
    return told
