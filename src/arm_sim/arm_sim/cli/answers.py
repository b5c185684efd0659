# SPDX-License-Identifier: Apache-2.0
"""Asks running nodes and shows what they answer; behind ``./arm call``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import click
import numpy as np

from arm_dynamics.ros import interfaces as dynamics
from arm_sim.cli.client import Caller
from arm_sim.cli.output import console, limit, number, show, table
from arm_sim.cli.vectors import Vector
from arm_sim.ros import interfaces as sim

DYNAMICS, _SIM = "./arm dynamics SCENE", "./arm sim SCENE"
SHOWN = 20  # points of a batch on a terminal
_DUST = 1e-14  # of the largest number beside it


class Question:
    """A question about motion: joints, their vectors, and how the answer is to look."""

    def __init__(
        self, caller: Caller, request: Any, joints: str, vectors: dict[str, Vector | None]
    ) -> None:
        info = caller.ask(dynamics.MODEL_INFO, dynamics.MODEL_INFO.type.Request())
        refuse_failure(info)
        request.joint_names = joints.replace(",", " ").split()
        self.names = request.joint_names or list(info.joint_names)
        self.types = dict(zip(info.joint_names, info.joint_types, strict=True))
        self.vectors = {name: v.flat(self.names) for name, v in vectors.items() if v is not None}
        self.batch = any(v.batch for v in vectors.values() if v is not None)
        for name, values in self.vectors.items():
            setattr(request, name, values)

    def shaped(self, values: Sequence[float], square: bool = False) -> np.ndarray:
        """Numbers of a response as one row (or matrix) for each point."""
        n = len(self.names)
        return np.reshape(values, (-1, n, n) if square else (-1, n))

    def plain(self, values: np.ndarray) -> Any:
        """Numbers for JSON: a list of points if points were given as a list."""
        return values.tolist() if self.batch else values.tolist()[0]

    def unit(self, turning: str, sliding: str) -> str:
        """The unit of the joints at hand, both where both kinds are."""
        kinds = {self.types.get(name) == "prismatic" for name in self.names}
        return ", ".join([turning] * (False in kinds) + [sliding] * (True in kinds))


def inverse_dynamics(terms: int, node: str, timeout: float, as_json: bool, **given: Any) -> None:
    """Ask for torques and print them."""
    request = dynamics.INVERSE_DYNAMICS.type.Request(terms=terms)
    _motion(dynamics.INVERSE_DYNAMICS, request, "effort", ("torque", "N m", "N"),
            node, timeout, as_json, **given)  # fmt: skip


def forward_dynamics(node: str, timeout: float, as_json: bool, **given: Any) -> None:
    """Ask for accelerations and print them."""
    request = dynamics.FORWARD_DYNAMICS.type.Request()
    _motion(dynamics.FORWARD_DYNAMICS, request, "acceleration", ("acceleration", "rad/s²", "m/s²"),
            node, timeout, as_json, **given)  # fmt: skip


def _motion(
    service: Any, request: Any, field: str, heading: tuple[str, str, str],
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None,
) -> None:  # fmt: skip
    with Caller(node, DYNAMICS, timeout) as caller:
        question = Question(caller, request, joints, vectors)
        response = caller.ask(service, request)
    refuse_failure(response, as_json)
    rows = question.shaped(getattr(response, field))
    if as_json:
        print_json(joint_names=question.names, **{field: question.plain(rows)})
        return
    title, unit = heading[0], question.unit(*heading[1:])
    if question.batch:
        _print_points(question, f"{title} [{unit}]", rows)
        return
    columns = {name: question.vectors.get(name) for name in vectors}
    given = {f"{name} [{_unit_of(name, question)}]": v for name, v in columns.items() if v}
    cells = zip(question.names, *given.values(), readable(rows[0]), strict=True)
    shown = [(name, *map(number, values)) for name, *values in cells]
    show(console(), table(("joint", *given, f"{title} [{unit}]"), shown))


def dynamics_terms(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Ask for the parts of the equation of motion and print them."""
    request = dynamics.DYNAMICS_TERMS.type.Request()
    with Caller(node, DYNAMICS, timeout) as caller:
        question = Question(caller, request, joints, vectors)
        response = caller.ask(dynamics.DYNAMICS_TERMS, request)
    refuse_failure(response, as_json)
    matrices = {
        name: question.shaped(getattr(response, name), square=True)
        for name in ("mass_matrix", "coriolis_matrix")
    }
    torques = {name: question.shaped(getattr(response, name)) for name in ("gravity", "friction")}
    energies = {
        name: np.array(getattr(response, name)) for name in ("kinetic_energy", "potential_energy")
    }
    if as_json:
        shaped = {**matrices, **torques, **energies}
        print_json(
            joint_names=question.names, **{name: question.plain(v) for name, v in shaped.items()}
        )
        return
    _print_terms(question, matrices, torques, energies)


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
    with Caller(node, DYNAMICS, timeout) as caller:
        info = caller.ask(dynamics.MODEL_INFO, dynamics.MODEL_INFO.type.Request())
    refuse_failure(info, as_json)
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
    _command(sim.RESET, {}, "back at its initial state, time zero", node, timeout, as_json)


def pause(data: bool, node: str, timeout: float, as_json: bool) -> None:
    """Stop a simulation, or let it go on."""
    said = "paused" if data else "running"
    _command(sim.PAUSE, {"data": data}, said, node, timeout, as_json)


def step(steps: int, node: str, timeout: float, as_json: bool) -> None:
    """Advance a paused simulation."""
    done = f"{steps} tick{'s' if steps > 1 else ''} further, t = {{time:.6g}} s"
    _command(sim.STEP, {"steps": steps}, done, node, timeout, as_json, repeatable=False)


def set_joint_state(
    node: str, timeout: float, as_json: bool, joints: str, **vectors: Vector | None
) -> None:
    """Put joints of a simulation somewhere."""
    given = {name: vector for name, vector in vectors.items() if vector is not None}
    names = joints.replace(",", " ").split()
    for vector in given.values():
        if vector.batch:
            raise click.ClickException("one state is wanted, several points were given")
        if vector.named and names and set(vector.named) != set(names):
            raise click.ClickException(
                f"joints {', '.join(vector.named)} and {', '.join(names)}; allowed: the same "
                "joints in --position, --velocity and --joints"
            )
        names = names or list(vector.named)
    fields = {name: vector.flat(names) for name, vector in given.items()}
    fields = {"joint_names": names, **fields}
    what = ", ".join(names) if names else "all joints"
    _command(sim.SET_JOINT_STATE, fields, f"{what} set", node, timeout, as_json)


def _command(
    service: Any, fields: dict[str, Any], done: str, node: str, timeout: float, as_json: bool,
    repeatable: bool = True,
) -> None:  # fmt: skip
    with Caller(node, _SIM, timeout) as caller:
        response = caller.ask(service, service.type.Request(**fields), repeatable)
    refuse_failure(response, as_json)
    answer = {"time": response.time} if hasattr(response, "time") else {}
    if as_json:
        print_json(**answer)
    else:
        console().print(f"{caller.node}: {done.format(**answer)}", markup=False)


def refuse_failure(response: Any, as_json: bool = False) -> None:
    """End the command with the node's message if it refused."""
    if response.success:
        return
    if as_json:
        click.echo(json.dumps({"success": False, "message": response.message}))
        raise SystemExit(1)
    raise click.ClickException(f"refused: {response.message}")


def print_json(**fields: Any) -> None:
    """Print an answer for scripts."""
    click.echo(json.dumps({"success": True, **fields}))


def _unit_of(name: str, question: Question) -> str:
    units = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"),
             "acceleration": ("rad/s²", "m/s²"), "effort": ("N m", "N")}  # fmt: skip
    return question.unit(*units[name])
