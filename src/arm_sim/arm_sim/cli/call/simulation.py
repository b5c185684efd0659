# SPDX-License-Identifier: Apache-2.0
"""Orders to a simulation, and what is said when they are carried out."""

from __future__ import annotations

from typing import Any

import click

from arm_sim.cli.call.asking import asking, print_json
from arm_sim.cli.call.options import SIM
from arm_sim.cli.output import console
from arm_sim.cli.vectors import Vector


def reset(node: str, timeout: float, as_json: bool) -> None:
    """Have a simulation start again."""
    with asking(node, SIM.start, timeout, as_json) as client:
        client.reset()
    _print_done("back at its initial state, time zero", node, as_json)


def reset_counters(node: str, timeout: float, as_json: bool) -> None:
    """Have a simulation's counters begin afresh."""
    with asking(node, SIM.start, timeout, as_json) as client:
        client.reset_counters()
    _print_done("counters at zero", node, as_json)


def pause(stop: bool, node: str, timeout: float, as_json: bool) -> None:
    """Stop a simulation, or let it go on."""
    with asking(node, SIM.start, timeout, as_json) as client:
        client.pause() if stop else client.resume()
    _print_done("paused" if stop else "running", node, as_json)


def step(steps: int, node: str, timeout: float, as_json: bool) -> None:
    """Advance a paused simulation."""
    with asking(node, SIM.start, timeout, as_json) as client:
        time = client.step(steps)
    ticks = f"{steps} tick{'s' if steps > 1 else ''}"
    _print_done(f"{ticks} further, t = {time:.6g} s", node, as_json, time=time)


def set_joint_state(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Put joints of a simulation somewhere."""
    names, rows = named_rows(joints, vectors)
    with asking(node, SIM.start, timeout, as_json) as client:
        client.set_joint_state(rows.get("position"), rows.get("velocity"), names)
    _print_done(f"{', '.join(names) if names else 'all joints'} set", node, as_json)


def set_payload(
    mass: float, com: Vector, inertia: Vector, index: int,
    node: str, timeout: float, as_json: bool,
) -> None:  # fmt: skip
    """Change a payload of a simulation."""
    with asking(node, SIM.start, timeout, as_json) as client:
        client.set_payload(mass, com.flat(()), inertia.flat(()), index)
    _print_done(f"payload {index} has {mass:g} kg", node, as_json)


def set_friction(viscous: Vector, joints: str, node: str, timeout: float, as_json: bool) -> None:
    """Change the viscous friction of a simulation."""
    names, rows = named_rows(joints, {"viscous": viscous})
    with asking(node, SIM.start, timeout, as_json) as client:
        client.set_friction(rows["viscous"], names)
    _print_done(f"friction of {', '.join(names) if names else 'all joints'} set", node, as_json)


def named_rows(
    joints: str, vectors: dict[str, Vector | None]
) -> tuple[list[str], dict[str, list[float]]]:
    """Joints that are meant, none for all, and one number for each in every vector given."""
    given = {name: vector for name, vector in vectors.items() if vector is not None}
    names = joints.replace(",", " ").split()
    for vector in given.values():
        if vector.batch:
            raise click.ClickException("one state is wanted, several points were given")
        if vector.named and names and set(vector.named) != set(names):
            raise click.ClickException(
                f"joints {', '.join(vector.named)} and {', '.join(names)}; allowed: the same "
                "joints in every vector and in --joints"
            )
        names = names or list(vector.named)
    return names, {name: vector.flat(names) for name, vector in given.items()}


def _print_done(done: str, node: str, as_json: bool, **answer: Any) -> None:
    if as_json:
        print_json(**answer)
    else:
        console().print(f"/{node.strip('/')}: {done}", markup=False)
