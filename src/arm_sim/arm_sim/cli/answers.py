# SPDX-License-Identifier: Apache-2.0
"""Asks running nodes and shows what they answer; behind ``./arm call``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click
import numpy as np

from arm_dynamics.client import ArmClient
from arm_dynamics.exceptions import NoAnswer, Refused
from arm_sim.cli.output import console, limit, number, show, table
from arm_sim.cli.vectors import Vector

DYNAMICS, _SIM = "./arm dynamics SCENE", "./arm sim SCENE"
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
                click.echo(json.dumps({"success": False, "message": str(error)}))
                raise SystemExit(1) from None
            raise click.ClickException(f"refused: {error}") from None


class Question:
    """A question about motion: joints, their vectors, and how the answer is to look."""

    def __init__(self, client: ArmClient, joints: str, vectors: dict[str, Vector | None]) -> None:
        facts = client.model_info()
        self.order = joints.replace(",", " ").split()
        self.names = self.order or list(facts.joint_names)
        self.types = dict(zip(facts.joint_names, facts.joint_types, strict=True))
        self.vectors = {name: v.array(self.names) for name, v in vectors.items() if v is not None}
        self.batch = any(v.batch for v in vectors.values() if v is not None)

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


def inverse_dynamics(
    terms: int, node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for torques and print them."""
    with asking(node, DYNAMICS, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        q, v, a = map(question.given, ("position", "velocity", "acceleration"))
        tau = client.inverse_dynamics(q, v, a, terms, question.order)
    _print_motion(question, "effort", ("torque", "N m", "N"), tau, as_json)


def forward_dynamics(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for accelerations and print them."""
    with asking(node, DYNAMICS, timeout, as_json) as client:
        question = Question(client, joints, vectors)
        q, v, tau = map(question.given, ("position", "velocity", "effort"))
        a = client.forward_dynamics(q, v, tau, question.order)
    _print_motion(question, "acceleration", ("acceleration", "rad/s²", "m/s²"), a, as_json)


def _print_motion(
    question: Question, field: str, heading: tuple[str, str, str], answer: np.ndarray,
    as_json: bool,
) -> None:  # fmt: skip
    rows = question.points(answer)
    if as_json:
        print_json(joint_names=question.names, **{field: question.plain(rows)})
        return
    title, unit = heading[0], question.unit(*heading[1:])
    if question.batch:
        _print_points(question, f"{title} [{unit}]", rows)
        return
    given = {f"{name} [{_unit_of(name, question)}]": v for name, v in question.vectors.items()}
    cells = zip(question.names, *given.values(), readable(rows[0]), strict=True)
    shown = [(name, *map(number, values)) for name, *values in cells]
    show(console(), table(("joint", *given, f"{title} [{unit}]"), shown))


def dynamics_terms(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for the parts of the equation of motion and print them."""
    with asking(node, DYNAMICS, timeout, as_json) as client:
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


def _print_points(question: Question, title: str, rows: np.ndarray) -> None:
    shown = [(str(k), *map(number, row)) for k, row in enumerate(readable(rows[:SHOWN]))]
    show(console(), table((f"point: {title}", *question.names), shown))
    say_more(len(rows))


def readable(values: np.ndarray) -> np.ndarray:
    """The same without the dust that rounding leaves where zero is meant."""
    return np.where(np.abs(values) < _DUST * np.abs(values).max(), 0.0, values)


def say_more(points: int) -> None:
    """Say how many points of a batch were not shown."""
    if points > SHOWN:
        console().print(f"… and {points - SHOWN} more points; --json prints all")


def model_info(node: str, timeout: float, as_json: bool) -> None:
    """Ask what the node knows about its arm and print it."""
    with asking(node, DYNAMICS, timeout, as_json) as client:
        info = client.model_info()
    limits = ("position_lower", "position_upper", "velocity_limits", "effort_limits")
    if as_json:
        print_json(
            joint_names=list(info.joint_names), joint_types=list(info.joint_types),
            **{name: [_or_none(x) for x in getattr(info, name)] for name in limits},
            frame_names=list(info.frame_names), total_mass=info.total_mass,
            gravity=list(map(float, info.gravity)), summary=info.summary,
        )  # fmt: skip
        return
    rows = zip(
        info.joint_names, info.joint_types, *(getattr(info, x) for x in limits), strict=True
    )
    heads = ("joint", "type", "lower", "upper", "speed limit", "effort limit")
    out = console()
    gravity = ", ".join(f"{g:g}" for g in info.gravity)
    out.print(f"\n{info.summary}, gravity ({gravity}) m/s²", markup=False)
    show(out, table(heads, [(name, kind, *map(limit, x)) for name, kind, *x in rows], (0, 1)))
    out.print(f"frames: {', '.join(info.frame_names)}", style="dim", markup=False)


def _or_none(value: float) -> float | None:
    """JSON knows no infinity."""
    return float(value) if np.isfinite(value) else None


def reset(node: str, timeout: float, as_json: bool) -> None:
    """Have a simulation start again."""
    with asking(node, _SIM, timeout, as_json) as client:
        client.reset()
    _print_done("back at its initial state, time zero", node, as_json)


def reset_counters(node: str, timeout: float, as_json: bool) -> None:
    """Have a simulation's counters begin afresh."""
    with asking(node, _SIM, timeout, as_json) as client:
        client.reset_counters()
    _print_done("counters at zero", node, as_json)


def pause(stop: bool, node: str, timeout: float, as_json: bool) -> None:
    """Stop a simulation, or let it go on."""
    with asking(node, _SIM, timeout, as_json) as client:
        client.pause() if stop else client.resume()
    _print_done("paused" if stop else "running", node, as_json)


def step(steps: int, node: str, timeout: float, as_json: bool) -> None:
    """Advance a paused simulation."""
    with asking(node, _SIM, timeout, as_json) as client:
        time = client.step(steps)
    ticks = f"{steps} tick{'s' if steps > 1 else ''}"
    _print_done(f"{ticks} further, t = {time:.6g} s", node, as_json, time=time)


def set_joint_state(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Put joints of a simulation somewhere."""
    names, rows = named_rows(joints, vectors)
    with asking(node, _SIM, timeout, as_json) as client:
        client.set_joint_state(rows.get("position"), rows.get("velocity"), names)
    _print_done(f"{', '.join(names) if names else 'all joints'} set", node, as_json)


def set_payload(
    mass: float, com: Vector, inertia: Vector, index: int,
    node: str, timeout: float, as_json: bool,
) -> None:  # fmt: skip
    """Change a payload of a simulation."""
    with asking(node, _SIM, timeout, as_json) as client:
        client.set_payload(mass, com.flat(()), inertia.flat(()), index)
    _print_done(f"payload {index} has {mass:g} kg", node, as_json)


def set_friction(viscous: Vector, joints: str, node: str, timeout: float, as_json: bool) -> None:
    """Change the viscous friction of a simulation."""
    names, rows = named_rows(joints, {"viscous": viscous})
    with asking(node, _SIM, timeout, as_json) as client:
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


def print_json(**fields: Any) -> None:
    """Print an answer for scripts."""
    click.echo(json.dumps({"success": True, **fields}))


def _unit_of(name: str, question: Question) -> str:
    units = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"),
             "acceleration": ("rad/s²", "m/s²"), "effort": ("N m", "N")}  # fmt: skip
    return question.unit(*units[name])
