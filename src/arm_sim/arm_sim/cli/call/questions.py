# SPDX-License-Identifier: Apache-2.0
"""Commands that call a dynamics node."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from arm_dynamics.exceptions import choices
from arm_sim.cli.call.asking import (
    DYNAMICS,
    SHOWN,
    VECTOR,
    Question,
    asks,
    call,
    joints,
    numbers,
    plain_rows,
    print_columns,
    print_joints,
    print_json,
    print_matrix,
    print_points,
    readable,
    say_more,
    split,
    vector,
)
from arm_sim.cli.output import console, examples, limit, number, show, table
from arm_sim.cli.vectors import Vector

if TYPE_CHECKING:
    import numpy as np

    from arm_dynamics.client import ArmClient, Postures

TERMS = {"inertia": 1, "coriolis": 2, "gravity": 4, "friction": 8, "spring": 16}


def _terms(context: click.Context, option: click.Parameter, text: str) -> int:
    chosen = set(split(context, option, text.lower()))
    if chosen == {"all"}:
        return sum(TERMS.values())
    if not chosen or not chosen <= set(TERMS):
        unknown = min(chosen - {*TERMS}, default="")
        raise click.BadParameter(f"{text!r}; allowed: all, or some of {choices(unknown, TERMS)}")
    return sum(TERMS[term] for term in chosen)


@call.command(
    short_help="Torques that produce a motion.",
    epilog=examples(
        './arm call inverse-dynamics --position "panda_joint2=-0.8 panda_joint4=-2.4"'
    ),
)
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@vector("acceleration", "Joint accelerations")
@click.option("--terms", default="all", show_default=True, callback=_terms,
              help="all, or some of inertia,coriolis,gravity,friction,spring.")  # fmt: skip
@joints
@asks(DYNAMICS)
def inverse_dynamics(
    client: ArmClient, as_json: bool, terms: int, joints: list[str], **vectors: Vector | None
) -> None:
    """Torques that produce a motion: M(q) a + C(q, v) v + G(q) + S(q, v) + F(v)."""
    question = Question(client, joints, vectors)
    q, v, a = question.given("position", "velocity", "acceleration")
    tau = client.inverse_dynamics(q, v, a, terms, question.order)
    _print_motion(question, "effort", tau, as_json, title="torque")


@call.command(epilog=examples('./arm call forward-dynamics --position "0 -0.8 0 -2.4 0 1.6 0.8"'))
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@vector("effort", "Joint torques in N m or N")
@joints
@asks(DYNAMICS)
def forward_dynamics(
    client: ArmClient, as_json: bool, joints: list[str], **vectors: Vector | None
) -> None:
    """Accelerations that torques produce."""
    question = Question(client, joints, vectors)
    q, v, tau = question.given("position", "velocity", "effort")
    a = client.forward_dynamics(q, v, tau, question.order)
    _print_motion(question, "acceleration", a, as_json)


@call.command(
    short_help="Mass matrix, Coriolis matrix, gravity, friction, springs, energies.",
    epilog=examples('./arm call dynamics-terms --position "0 -0.8 0 -2.4 0 1.6 0.8" --json'),
)
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@joints
@asks(DYNAMICS)
def dynamics_terms(
    client: ArmClient, as_json: bool, joints: list[str], **vectors: Vector | None
) -> None:
    """Mass matrix, Coriolis matrix, gravity, friction, springs and energies."""
    question = Question(client, joints, vectors)
    terms = client.dynamics_terms(*question.given("position", "velocity"), question.order)
    torques = ("gravity", "friction", "spring")
    names = ("mass_matrix", "coriolis_matrix", *torques, "kinetic_energy", "potential_energy")
    found = {name: question.points(getattr(terms, name)) for name in names}
    if as_json:
        plain = {name: question.plain(values) for name, values in found.items()}
        print_json(joint_names=question.names, **plain)
        return
    for k in _points(question, len(found["kinetic_energy"])):
        for name, unit in (("mass_matrix", "inertia"), ("coriolis_matrix", "damping")):
            heading = f"{name.replace('_', ' ')} [{question.unit(unit)}]"
            print_matrix(heading, question.names, question.names, found[name][k])
        torque = question.unit("effort")
        columns = {f"{name} [{torque}]": found[name][k] for name in torques}
        print_columns("joint", question.names, columns)
        for name in ("kinetic_energy", "potential_energy"):
            console().print(f"  {name.replace('_', ' ')}: {number(found[name][k])} J")


@call.command(
    short_help="Inertia, gravity, Jacobian and more at a frame.",
    epilog=examples(
        './arm call task-space --frame panda_hand --position "0 -0.8 0 -2.4 0 1.6 0.8"',
        './arm call task-space --frame panda_hand --axes "x y z" --direction "0 0 1" \\',
        '      --position "panda_joint2=-0.8 panda_joint4=-2.4 panda_joint6=1.6"',
    ),
)
@click.option("--frame", required=True, help="A moving frame; model-info lists them.")
@click.option("--reference", default="local_world_aligned", show_default=True,
              help="Axes and point: local_world_aligned, local or world.")  # fmt: skip
@click.option("--axes", default="pose", show_default=True, callback=split,
              help='pose, position, orientation, or some of "x y z rx ry rz".')  # fmt: skip
@click.option(
    "--direction",
    type=VECTOR,
    help="Also print the effective mass along this direction, one number per axis.",
)
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@joints
@asks(DYNAMICS)
def task_space(
    client: ArmClient,
    as_json: bool,
    frame: str,
    reference: str,
    axes: list[str],
    direction: Vector | None,
    joints: list[str],
    **vectors: Vector | None,
) -> None:
    """The equation of motion in task space: inertia, velocity terms, gravity, Jacobian."""
    question = Question(client, joints, vectors)
    q, v = question.given("position", "velocity")
    if direction is not None and len(direction.rows) != 1:
        raise click.ClickException("--direction: one row of numbers is expected, one per axis")
    found = client.task_space(
        frame, q, v, reference=reference, axes=axes,
        direction=() if direction is None else direction.rows[0], joint_names=question.order,
    )  # fmt: skip
    names, _ = list(found.pop("axes")), found.pop("joint_names")
    answer = {name: question.points(values) for name, values in found.items()}
    if as_json:
        plain = {name: _json(question.plain(values)) for name, values in answer.items()}
        print_json(joint_names=question.names, axes=names, **plain)
        return
    for k in _points(question, len(answer["damped"])):
        _print_task(question, names, {name: values[k] for name, values in answer.items()})


@call.command(
    short_help="Joint positions for a pose of a frame.",
    epilog=examples(
        './arm call inverse-kinematics --frame panda_hand --pose "0.4 0.2 0.5 1 0 0 0"',
        "./arm call inverse-kinematics --frame panda_hand --axes position \\",
        '      --pose "[[0.4, 0.2, 0.5, 0, 0, 0, 1], [0.4, 0.3, 0.5, 0, 0, 0, 1]]"',
    ),
)
@click.option("--frame", required=True, help="A moving frame; model-info lists them.")
@click.option("--pose", type=VECTOR, required=True,
              help="Position x y z in m and quaternion x y z w of the frame in the world; "
                   "[[…], […]] for two poses, or @FILE.")  # fmt: skip
@click.option("--axes", default="pose", show_default=True, callback=split,
              help='pose, position, orientation, or some of "x y z rx ry rz".')  # fmt: skip
@click.option("--seed", type=VECTOR,
              help="Joint positions to start from; the scene's when omitted.")  # fmt: skip
@joints
@asks(DYNAMICS)
def inverse_kinematics(
    client: ArmClient,
    as_json: bool,
    frame: str,
    pose: Vector,
    axes: list[str],
    seed: Vector | None,
    joints: list[str],
) -> None:
    """Joint positions, within limits, that bring a frame to a pose.

    If a pose is not reached, the nearest solution is printed and the exit status is 1. For several
    poses, each search starts from the result of the previous one.
    """
    from arm_dynamics.client import NotReached

    poses, missed = plain_rows("--pose", pose), ""
    question = Question(client, joints, {"seed": seed})
    try:
        found = client.inverse_kinematics(
            frame, poses, *question.given("seed"), axes=axes, joint_names=question.order
        )
    except NotReached as error:
        found, missed = error.found, str(error)
    if as_json:
        fields = {"position": found.q, "reached": found.reached,
                  "distance": found.distance, "angle": found.angle}  # fmt: skip
        plain = {name: values.tolist() for name, values in fields.items()}
        print_json(missed, joint_names=question.names, **plain)
        raise SystemExit(bool(missed))
    _print_postures(question, found)
    if missed:
        raise click.ClickException(missed)


def _one_direction(
    inverse: bool, effort: Vector | None, multipliers: Vector | None,
    acceleration: Vector | None, **_: Any,
) -> None:  # fmt: skip
    if inverse and effort is not None:
        raise click.UsageError("--effort and --inverse exclude each other; give one of them")
    if not inverse and (multipliers or acceleration):
        raise click.UsageError("--acceleration and --multipliers are allowed with --inverse only")


@call.command(
    short_help="Accelerations and forces under the scene's constraints.",
    epilog=examples(
        './arm call constrained-dynamics --position "0 0.6 -0.6 0.6 0.6 -0.6 0.6" \\',
        '      --effort "left_driver_joint=0.1"',
        './arm call constrained-dynamics --position "0 0.6 -0.6 0.6 0.6 -0.6 0.6" \\',
        '      --inverse --acceleration "wrist=2"',
    ),
)
@vector("position", "Joint positions in rad or m that satisfy the constraints", required=True)
@vector("velocity", "Joint velocities")
@vector("effort", "Joint torques in N m or N")
@click.option("--inverse", is_flag=True,
              help="Compute torques, from --acceleration and --multipliers.")  # fmt: skip
@vector("acceleration", "Joint accelerations")
@click.option("--multipliers", type=VECTOR,
              help="Forces on the constraints in N or N m; zero when omitted.")  # fmt: skip
@joints
@asks(DYNAMICS, check=_one_direction)
def constrained_dynamics(
    client: ArmClient,
    as_json: bool,
    inverse: bool,
    multipliers: Vector | None,
    joints: list[str],
    **vectors: Vector | None,
) -> None:
    """Accelerations and forces that torques produce under the scene's constraints.

    tau = M a + C v + G + S + F + A^T lambda with A v = 0. lambda is the force of the arm on
    the constraints: force and moment of a constraint's first frame on its second.
    """
    question = Question(client, joints, vectors)
    q, v, a, tau = question.given("position", "velocity", "acceleration", "effort")
    if inverse:
        forces = None if multipliers is None else plain_rows("--multipliers", multipliers)
        tau = client.constrained_inverse_dynamics(q, v, a, forces, question.order)
        _print_motion(question, "effort", tau, as_json, title="torque")
        return
    found = client.constrained_dynamics(q, v, tau, question.order)
    names, forces = list(found.constraint_names), question.points(found.multipliers)
    if as_json:
        print_json(
            joint_names=question.names, constraint_names=names,
            acceleration=question.plain(question.points(found.acceleration)),
            multipliers=question.plain(forces),
        )  # fmt: skip
        return
    _print_motion(question, "acceleration", found.acceleration, as_json=False)
    if not names:
        console().print("  the scene has no constraints")
    elif question.batch:
        print_points("force [N, N m]", _numbered(names), numbers(forces))
    else:
        print_columns("constraint", _numbered(names), {"force [N, N m]": forces[0]})


@call.command(
    short_help="Joints, limits, frames and mass of the node's arm.",
    epilog=examples("./arm call model-info"),
)
@asks(DYNAMICS)
def model_info(client: ArmClient, as_json: bool) -> None:
    """Properties of the node's arm: joints, limits, frames, mass."""
    info = client.model_info()
    limits = ("position_lower", "position_upper", "velocity_limits", "effort_limits")
    if as_json:
        print_json(
            joint_names=list(info.joint_names), joint_types=list(info.joint_types),
            **{name: _json(getattr(info, name).tolist()) for name in limits},
            frame_names=list(info.frame_names), total_mass=info.total_mass,
            gravity=info.gravity.tolist(), summary=info.summary,
        )  # fmt: skip
        return
    out, gravity = console(), ", ".join(f"{g:g}" for g in info.gravity)
    out.print(f"\n{info.summary}, gravity ({gravity}) m/s²", markup=False)
    columns = (getattr(info, name) for name in limits)
    rows = zip(info.joint_names, info.joint_types, *columns, strict=True)
    heads = ("joint", "type", "lower", "upper", "speed limit", "effort limit")
    show(out, table(heads, [(name, kind, *map(limit, x)) for name, kind, *x in rows], (0, 1)))
    out.print(f"frames: {', '.join(info.frame_names)}", style="dim", markup=False)


# --- showing -----------------------------------------------------------------------------------


def _print_motion(
    question: Question, field: str, answer: np.ndarray, as_json: bool, title: str = ""
) -> None:
    """Print one joint vector, named ``field`` in JSON."""
    rows = question.points(answer)
    if as_json:
        print_json(joint_names=question.names, **{field: question.plain(rows)})
    else:
        print_joints(question, field, rows, title)


def _points(question: Question, count: int) -> Iterator[int]:
    """The points that are printed in full, each under a heading."""
    for k in range(min(count, SHOWN)):
        if question.batch:
            console().rule(f"point {k}")
        yield k
    say_more(count)


def _print_task(question: Question, axes: list[str], answer: dict[str, Any]) -> None:
    out, pose = console(), [number(x) for x in readable(answer["pose"])]
    out.print(f"\n  position {', '.join(pose[:3])} m, quaternion xyzw {', '.join(pose[3:])}")
    print_matrix("inertia [kg, kg m, kg m²]", axes, axes, answer["inertia"])
    print_matrix("Jacobian", axes, question.names, answer["jacobian"])
    columns = {
        "velocity [m/s, rad/s]": answer["twist"], "bias [m/s², rad/s²]": answer["bias"],
        "Coriolis [N, N m]": answer["coriolis"], "gravity [N, N m]": answer["gravity"],
        "springs [N, N m]": answer["spring"],
    }  # fmt: skip
    print_columns("axis", axes, columns)
    condition = number(answer["condition"])
    out.print(f"  manipulability {number(answer['manipulability'])}, condition {condition}")
    if "effective_mass" in answer:
        at_least = "at least " if answer["effective_mass_bounded"] else ""
        out.print(f"  mass along the direction: {at_least}{number(answer['effective_mass'])}")
    if answer["damped"]:
        out.print("  near a singularity: inertia, Coriolis and gravity are bounded, not exact")


def _print_postures(question: Question, found: Postures) -> None:
    if found.q.ndim == 1:
        print_joints(question, "position", found.q[None])
        reached, distance, angle = _ended(found.reached, found.distance, found.angle)
        console().print(f"  reached: {reached}, off by {distance} m and {angle} rad")
        return
    ends = map(_ended, found.reached, found.distance, found.angle)
    rows = [[*row, *end] for row, end in zip(numbers(found.q), ends, strict=True)]
    heads = (*question.names, "reached", "off by [m]", "[rad]")
    title = f"position [{question.unit('position')}]"
    print_points(title, heads, rows, what="pose")


def _ended(reached: bool, distance: float, angle: float) -> tuple[str, str, str]:
    return "yes" if reached else "no", number(distance, 2), number(angle, 2)


def _numbered(names: list[str]) -> list[str]:
    """Number the rows of a constraint."""
    return [
        f"{name} {names[: k + 1].count(name)}" if names.count(name) > 1 else name
        for k, name in enumerate(names)
    ]


def _json(values: Any) -> Any:
    """JSON has no infinity: null."""
    if isinstance(values, list):
        return [_json(value) for value in values]
    return values if math.isfinite(values) else None
