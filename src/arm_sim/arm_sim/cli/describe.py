# SPDX-License-Identifier: Apache-2.0
"""``./arm describe``: content of a scene, computations of a tick, and their cost."""

from __future__ import annotations

import json
import math
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import console, examples, facts, limit, number, show, table, waiting

if TYPE_CHECKING:
    from rich.console import Console

    from arm_dynamics import ArmModel
    from arm_dynamics.arrays import Array
    from arm_dynamics.scene.spring import PointSpring
    from arm_sim import Simulator


@click.command(
    epilog=examples(
        "./arm describe panda",
        "./arm describe package://example-robot-data/robots/panda_description/urdf/panda.urdf",
        "./arm describe my_scene.yaml --integrator euler --dt 0.0005",
        "./arm describe my_scene.yaml --tolerance 1e-8",
    )
)
@click.argument("scene", type=SCENE)
@click.option("--integrator", help="Integration method, instead of the scene's, e.g. rk4, dop853.")
@click.option("--dt", type=float, help="Length of a time step in s, instead of the scene's.")
@click.option(
    "--tolerance", type=float, help="Control the error inside each time step, e.g. 1e-8."
)
@click.option(
    "--details",
    is_flag=True,
    help="Also show the comment at the top of the file, and why each part is skipped.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def describe(
    scene: str,
    integrator: str | None,
    dt: float | None,
    tolerance: float | None,
    details: bool,
    as_json: bool,
) -> None:
    """Show the joints of SCENE, what is computed and what is skipped, and the cost of a tick.

    SCENE is the name of a ready scene, or a scene file (YAML) or URDF: a path or a package:// URI.
    The time is measured on this machine.
    """
    from arm_dynamics import ModelError
    from arm_dynamics.dynamics.built import arm_model
    from arm_dynamics.scene.load import naming
    from arm_sim import Simulator

    with waiting(f"building {scene}"):
        model = arm_model(scene)
        try:
            with naming(scene):
                simulator = Simulator(model, integrator=integrator, dt=dt, tolerance=tolerance)
        except ModelError as error:  # some joint moves no mass, but all can be listed
            _describe_unmoved(model, str(error), as_json)
            return
        motion_of(simulator)  # number of runs for measuring the time of a tick
    if as_json:
        click.echo(json.dumps({**robot_of(model), **motion_of(simulator)}, indent=1))
        return
    out = console()
    if details:
        _show_comment(out, scene)
    _show_robot(out, model)
    _show_joints(out, model)
    _show_physics(out, simulator, details)
    _show_cost(out, simulator)


def _describe_unmoved(model: ArmModel, why: str, as_json: bool) -> None:
    """Show the joints of an arm that cannot be simulated, and why."""
    from rich.markup import escape

    from arm_dynamics.model.regularity import MASSLESS

    why = MASSLESS if model.massless else why
    if as_json:
        click.echo(json.dumps({**robot_of(model), "not_simulated": why}, indent=1))
        return
    out = console()
    _show_robot(out, model)
    _show_joints(out, model)
    out.print(f"[yellow]not simulated:[/] {escape(why)}")


def robot_of(model: ArmModel) -> dict[str, Any]:
    """The robot as a dictionary for --json; null for no limit."""
    columns = {
        "start": model.q0, "lower": model.position_lower, "upper": model.position_upper,
        "velocity_limit": model.velocity_limit, "effort_limit": model.effort_limit,
        "viscous": model.viscous, "coulomb": model.friction.coulomb.mean,
        "static": model.friction.static.mean, "armature": model.armature,
    }  # fmt: skip
    joints = [
        {"name": name, "type": model.joint_types[i], "command_unit": model.command_unit[i],
         **{key: _finite(values[i]) for key, values in columns.items()}}
        for i, name in enumerate(model.joint_names)
    ]  # fmt: skip
    return {
        "robot": model.pin.name, "mass": model.total_mass, "gravity": list(model.scene.gravity),
        "locked": list(model.scene.robot.lock),
        "links": {name: body.mass for name, body in model.scene.links.items()},
        "placeholders": model.placeholders, "joints": joints,
        "frames": list(model.frame_names),
    }  # fmt: skip


def motion_of(simulator: Simulator) -> dict[str, Any]:
    """What computes its motion, likewise."""
    plan, choice = simulator.plan, simulator.choice
    return {
        "dt": choice.dt, "integrator": choice.method.name, "tolerance": choice.tolerance,
        "reason": plan.reason, "algorithm": plan.algorithm, "backend": plan.backend,
        "operations": plan.operations, "nanoseconds": plan.nanoseconds,
        "computed": {part.name: part.why for part in plan.parts if part.on},
        "skipped": {part.name: part.why for part in plan.parts if not part.on},
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _show_comment(out: Console, scene: str) -> None:
    """Show the comment that begins a scene file, such as where its numbers are from."""
    from arm_dynamics.scene.files import find_scene

    path = find_scene(scene, Path.cwd())
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    comment = takewhile(lambda line: line.startswith("#"), lines)
    said = " ".join(line.lstrip("# ") for line in comment)
    if said:
        out.print(f"\n{said}", style="dim", markup=False, highlight=False)


def _show_robot(out: Console, model: ArmModel) -> None:
    from rich.markup import escape

    gravity = ", ".join(f"{g:g}" for g in model.scene.gravity)
    joints = f"{model.n} joint{'s' if model.n > 1 else ''}"
    out.print(
        f"\n[bold]{escape(model.pin.name)}[/]: {joints}, {model.total_mass:.6g} kg moving, "
        f"gravity \\[{gravity}] m/s²"
    )
    if model.scene.robot.lock:
        out.print(f"locked: {escape(', '.join(model.scene.robot.lock))}")
    if model.scene.links:
        masses = (f"{name} {body.mass:g} kg" for name, body in model.scene.links.items())
        out.print(f"inertias from the scene: {escape(', '.join(masses))}")
    for link, trouble in model.doubtful.items():
        out.print(escape(f"link '{link}': {trouble}"), style="yellow")


def _show_joints(out: Console, model: ArmModel) -> None:
    from rich.markup import escape

    columns, absent = _joint_columns(model)
    write = {name: limit if name.endswith(("limit", "er")) else number for name in columns}
    rows = [
        (name, model.joint_types[i], *(write[c](values[i], 4) for c, values in columns.items()))
        for i, name in enumerate(model.joint_names)
    ]
    show(out, table(("joint", "type", *columns), rows, text=(0, 1)))
    if absent:
        out.print(f"all zero: {', '.join(absent)}", style="dim")
    out.print(_units(set(model.joint_types)), style="dim")
    if model.placeholders:
        named = ", ".join(f"{name} ({why})" for name, why in model.placeholders.items())
        out.print(
            f"[yellow]limits that are probably placeholders:[/] {escape(named)}; a scene's "
            "joints.NAME.limits gives others"
        )
    _show_drives(out, model)
    _show_springs(out, model)
    _show_outside(out, model)


def _joint_columns(model: ArmModel) -> tuple[dict[str, Array], list[str]]:
    """Numbers of the joints by heading, and names of those that are all zero."""
    friction = model.friction
    columns = {
        "start": model.q0, "lower": model.position_lower, "upper": model.position_upper,
        "speed\nlimit": model.velocity_limit, "effort\nlimit": model.effort_limit,
    }  # fmt: skip
    drives = {
        "viscous\nfriction": model.viscous, "Coulomb\nfriction": friction.coulomb.mean,
        "armature": model.armature,
    }  # fmt: skip
    if (friction.static.mean != friction.coulomb.mean).any():
        drives["static\nfriction"] = friction.static.mean
    absent = [name.replace("\n", " ") for name, values in drives.items() if not values.any()]
    return columns | {name: values for name, values in drives.items() if values.any()}, absent


def _show_drives(out: Console, model: ArmModel) -> None:
    import numpy as np

    if not any(model.drives):
        return
    columns = ("joint", "command", "at most", "gear\nratio", "rotor inertia\nat the joint",
               "efficiency", "transmission")  # fmt: skip
    rows = [
        (
            name, f"{drive.motor.command} [{model.command_unit[i]}]",
            limit(model.command_limit[i], 4), number(drive.motor.gear_ratio, 4),
            number(drive.rotor_inertia, 4), number(drive.motor.efficiency, 4), drive.transmission,
        )
        for i, (name, drive) in enumerate(zip(model.joint_names, model.drives, strict=True))
        if drive is not None
    ]  # fmt: skip
    show(out, table(columns, rows, text=(0, 1, 6)))
    for name, drive, kind in zip(model.joint_names, model.drives, model.joint_types, strict=True):
        if drive is not None and np.isfinite(drive.overspeed):
            unit = "m/s" if kind == "prismatic" else "rad/s"
            out.print(
                f"{name}: beyond {drive.overspeed:.4g} {unit} the current limit holds, and the "
                "voltage limit cannot", markup=False,
            )  # fmt: skip


def _show_springs(out: Console, model: ArmModel) -> None:
    from arm_dynamics.scene.spring import spring_name

    springs = model.springs
    if not springs:
        return
    names = list(model.pin.names)[1:]
    rows = [
        (
            name, "joint", number(springs.stiffness[i], 4) if table is None else "table",
            number(springs.rest[i], 4), number(springs.damping[i], 4),
        )
        for i, (name, table) in enumerate(zip(names, springs.tables, strict=True))
        if springs.of_joints[i]
    ]  # fmt: skip
    rows += [
        (spring_name(spring, i), _between(spring),
         *(number(x, 4) for x in (spring.stiffness, spring.rest_length, spring.damping)))
        for i, spring in enumerate(springs.points)
    ]  # fmt: skip
    columns = ("spring", "of", "stiffness", "at rest", "damping")
    show(out, table(columns, rows, text=(0, 1)))


def _between(spring: PointSpring) -> str:
    kind = "cord, " if spring.tension_only else ""
    preload = f", {spring.force:g} N" if spring.force else ""
    return f"{kind}{' to '.join(spring.frames)}{preload}"


def _show_outside(out: Console, model: ArmModel) -> None:
    import numpy as np
    from rich.markup import escape

    if model.stops.contradicting:
        left_out = escape(", ".join(model.stops.contradicting))
        out.print(
            f"[yellow]limits left out:[/] {left_out}; with those of "
            "the joints that they follow they allow no motion"
        )
    outside = (model.q0 < model.position_lower) | (model.position_upper < model.q0)
    at_stop = model.stops.touched(model.q0) & ~outside
    for what, joints in {"outside its limits": outside, "at its stop": at_stop}.items():
        if joints.any():
            names = escape(", ".join(np.array(model.joint_names)[joints]))
            out.print(
                f"[yellow]starts {what}:[/] {names}; a scene's initial.position changes that"
            )


def _units(types: set[str]) -> str:
    turning = "rad, rad/s, N m, viscous friction N m s/rad, armature kg m²"
    sliding = "m, m/s, N, viscous friction N s/m, armature kg"
    if types == {"prismatic"}:
        return f"units: {sliding}"
    return f"units: {turning}" + (f"; sliding joints: {sliding}" if "prismatic" in types else "")


def _show_physics(out: Console, simulator: Simulator, details: bool) -> None:
    parts = sorted(simulator.plan.parts, key=lambda part: not part.on)
    rows = [("computed" if p.on else "skipped", p.name, p.why) for p in parts if p.on or details]
    show(out, table(("in a time step", "", ""), rows, text=(0, 1, 2)))
    if not details:
        skipped = ", ".join(part.name for part in parts if not part.on)
        out.print(f" skipped    {skipped}; --details says why", style="dim")
        out.print()


def _show_cost(out: Console, simulator: Simulator) -> None:
    plan, choice = simulator.plan, simulator.choice
    method, microseconds = choice.method, plan.nanoseconds / 1e3
    control = "" if choice.tolerance is None else f", error controlled to {choice.tolerance:g}"
    step = "sub-step" if choice.tolerance else "time step"
    how = f"{method.name}, order {method.order}, {simulator.dt:g} s{control}"
    faster = f"{simulator.dt * 1e6 / microseconds:,.0f} times faster than real time"
    out.print(facts([
        ("integrator", f"{how} ({plan.reason})"),
        ("algorithm", plan.algorithm),
        ("runs on", plan.backend),
        ("operations", f"{plan.operations} in a {step}, {plan.evaluation} in one evaluation"),
        ("time", f"{microseconds:.2f} µs for a time step, measured now; {faster}"),
    ]))  # fmt: skip
    out.print()
